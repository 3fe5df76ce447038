"""Meshes of other packages in and out, and what other packages make of meshes.

    uv, info = proxel.unwrap(*interop.faces(trimesh.load("a.stl", process=False)))
    X, info = proxel.deform(*interop.tets(meshio.read("a.vtu")), pins=...)

`faces` and `tets` take a path, or a mesh of trimesh, meshio or pyvista; `to_trimesh`, `to_meshio`, `to_pyvista` and
`to_polyscope` give one. Nothing is renumbered; what a package merges when it reads a file it has merged before (trimesh
does, unless it is told `process=False`). None of these packages is needed by Proxel itself: `pip install
'proxel[trimesh]'`, `[meshio]`, `[pyvista]`, `[polyscope]`, `[tetwild]`, `[scipy]`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays
from ._core import InputError
from ._extras import extra
from ._meshfile import MeshFile, of_meshio, read_mesh

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "MeshFile",
    "cotangent_laplacian",
    "faces",
    "gradient_operator",
    "read_mesh",
    "tetrahedralize",
    "tets",
    "to_meshio",
    "to_polyscope",
    "to_pyvista",
    "to_trimesh",
]

#: Cell types of VTK, by the corners of a linear cell.
VTK_TRIANGLE, VTK_QUAD, VTK_TETRA = 5, 9, 10


def _mesh(mesh: Any) -> MeshFile:
    """What a path or an object of another package holds."""
    if isinstance(mesh, MeshFile):
        return mesh
    if isinstance(mesh, (str, os.PathLike)):
        return read_mesh(mesh)
    package = type(mesh).__module__.split(".")[0]
    if package == "meshio":
        return of_meshio(mesh, "the mesh")
    if package == "pyvista":
        return _of_pyvista(mesh)
    if package == "trimesh" and hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return MeshFile(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64), None)
    raise InputError(
        f"a {type(mesh).__module__}.{type(mesh).__name__} is no mesh that is known here; give a path, a "
        "trimesh.Trimesh, a meshio.Mesh, a pyvista.PolyData or a pyvista.UnstructuredGrid"
    )


def _of_pyvista(mesh: Any) -> MeshFile:
    V = np.asarray(mesh.points, dtype=np.float64)
    if hasattr(mesh, "cells_dict"):
        cells = {int(kind): np.asarray(c, dtype=np.int64) for kind, c in mesh.cells_dict.items()}
        surface = [cells[kind] for kind in (VTK_TRIANGLE, VTK_QUAD) if kind in cells]
        if not surface and VTK_TETRA not in cells:
            raise InputError(f"the mesh has cells of VTK's types {sorted(cells)}; give triangles, quads or tetrahedra")
        F: Any = None
        if surface:
            F = surface[0] if len(surface) == 1 else [face.tolist() for block in surface for face in block]
        return MeshFile(V, F, cells.get(VTK_TETRA))
    # A list of faces, each after its number of corners.
    flat, polygons, at = np.asarray(mesh.faces, dtype=np.int64), [], 0
    while at < len(flat):
        polygons.append(flat[at + 1 : at + 1 + flat[at]])
        at += 1 + int(flat[at])
    same = len({len(p) for p in polygons}) == 1
    return MeshFile(V, np.array(polygons) if same else [p.tolist() for p in polygons], None)


def faces(mesh: Any) -> tuple[NDArray[np.float64], Any]:
    """Positions (n, 3) and faces of a path or a mesh of trimesh, meshio or pyvista: an array (m, k), or a list where
    faces differ in size. Raises InputError for a mesh without faces."""
    known = _mesh(mesh)
    if known.F is None:
        raise InputError("the mesh has tetrahedra and no faces; give its surface, or take tets(mesh)")
    return known.V, known.F


def tets(mesh: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Positions (n, 3) and tetrahedra (m, 4), likewise. Raises InputError for a mesh without tetrahedra."""
    known = _mesh(mesh)
    if known.T is None:
        raise InputError("the mesh has no tetrahedra; fill its surface by tetrahedralize(V, F), or deform the surface")
    return known.V, known.T


def _triangles(F: Any) -> NDArray[np.int64]:
    """Fans of faces, for packages that know triangles only."""
    rows = [np.asarray(face, dtype=np.int64) for face in F]
    return np.array([[r[0], r[k], r[k + 1]] for r in rows for k in range(1, len(r) - 1)]).reshape(-1, 3)


def to_trimesh(V: ArrayLike, F: Any, uv: ArrayLike | None = None, uv_faces: Any = None) -> Any:
    """A `trimesh.Trimesh`; larger faces become fans of triangles. With a map `uv` (k, 2), and its corners `uv_faces`
    where it is cut, it has texture coordinates and a vertex for each row of `uv`, as trimesh knows no seams.

    Raises InputError where a face of a map is not mapped, or trimesh is not installed.
    """
    trimesh = extra("trimesh", "trimesh", "to_trimesh")
    points = _arrays.points(V)
    if uv is None:
        return trimesh.Trimesh(points, _triangles(F), process=False)
    flat, corners = _arrays.table(uv, 2, "uv"), F if uv_faces is None else uv_faces
    who = np.concatenate([np.ravel(face) for face in F])
    where = np.concatenate([np.ravel(face) for face in corners]).astype(np.int64)
    if who.shape != where.shape or (where < 0).any():
        raise InputError(
            "uv_faces: a face is not mapped, or has another number of corners than in F; leave it out of F"
        )
    # Each row of uv is that of one vertex; vertices that no face uses have no texture and are left out.
    owner = np.zeros(len(flat), dtype=np.int64)
    owner[where] = who
    mesh = trimesh.Trimesh(points[owner], _triangles(corners), process=False)
    mesh.visual = trimesh.visual.TextureVisuals(uv=flat)
    return mesh


def to_meshio(
    V: ArrayLike,
    F: Any = None,
    T: ArrayLike | None = None,
    point_data: Mapping[str, ArrayLike] | None = None,
) -> Any:
    """A `meshio.Mesh` of faces, tetrahedra, or both, with arrays (n,) or (n, d) of its vertices.

    Faces of one size stay in their order; those of several go into a block for each size.
    """
    meshio = extra("meshio", "meshio", "to_meshio")
    blocks: list[tuple[str, Any]] = []
    if F is not None:
        by_size: dict[int, list[Any]] = {}
        for face in F:
            by_size.setdefault(len(face), []).append(np.asarray(face))
        names = {3: "triangle", 4: "quad"}
        blocks += [(names.get(size, "polygon"), np.array(rows)) for size, rows in by_size.items()]
    if T is not None:
        blocks.append(("tetra", np.asarray(T)))
    if not blocks:
        raise InputError("to_meshio: there are neither faces nor tetrahedra; give F or T")
    data = {name: np.asarray(values) for name, values in (point_data or {}).items()}
    return meshio.Mesh(_arrays.points(V), blocks, point_data=data)


def to_pyvista(
    V: ArrayLike,
    F: Any = None,
    T: ArrayLike | None = None,
    point_data: Mapping[str, ArrayLike] | None = None,
    uv: ArrayLike | None = None,
) -> Any:
    """A `pyvista.PolyData` of faces, or a `pyvista.UnstructuredGrid` of tetrahedra, with arrays of its vertices; `uv`
    (n, 2), of a map without seams, become its texture coordinates."""
    pyvista = extra("pyvista", "pyvista", "to_pyvista")
    points = _arrays.points(V)
    if (F is None) == (T is None):
        raise InputError("to_pyvista: give either faces F or tetrahedra T")
    if T is not None:
        mesh = pyvista.UnstructuredGrid({VTK_TETRA: np.asarray(T, dtype=np.int64)}, points)
    else:
        flat = np.concatenate([np.r_[len(face), np.asarray(face)] for face in F]).astype(np.int64)
        mesh = pyvista.PolyData(points, flat)
    for name, values in (point_data or {}).items():
        mesh.point_data[name] = np.asarray(values)
    if uv is not None:
        flat_uv = _arrays.table(uv, 2, "uv")
        if len(flat_uv) != len(points):
            raise InputError(
                f"uv: it has {len(flat_uv)} rows for {len(points)} vertices: the map is cut; use to_trimesh"
            )
        mesh.active_texture_coordinates = flat_uv
    return mesh


def to_polyscope(
    name: str,
    V: ArrayLike,
    F: Any = None,
    T: ArrayLike | None = None,
    point_data: Mapping[str, ArrayLike] | None = None,
    uv: ArrayLike | None = None,
    uv_faces: Any = None,
) -> Any:
    """Registers a structure with polyscope (after `polyscope.init()`, before `polyscope.show()`) and returns it: a
    surface mesh, or a volume mesh of tetrahedra. `point_data` (n,) are scalars, (n, 3) vectors; a map is shown by its
    checkerboard, with `uv_faces` on corners."""
    polyscope = extra("polyscope", "polyscope", "to_polyscope")
    points = _arrays.points(V)
    if (F is None) == (T is None):
        raise InputError("to_polyscope: give either faces F or tetrahedra T")
    if T is not None:
        shown = polyscope.register_volume_mesh(name, points, tets=np.asarray(T))
    else:
        shown = polyscope.register_surface_mesh(name, points, F if isinstance(F, np.ndarray) else list(F))
    for label, values in (point_data or {}).items():
        numbers = np.asarray(values)
        add = shown.add_scalar_quantity if numbers.ndim == 1 else shown.add_vector_quantity
        add(label, numbers)
    if uv is not None:
        flat = _arrays.table(uv, 2, "uv")
        if uv_faces is None:
            shown.add_parameterization_quantity("uv", flat, defined_on="vertices", enabled=True)
        else:
            corners = np.concatenate([np.ravel(face) for face in uv_faces])
            shown.add_parameterization_quantity("uv", flat[corners], defined_on="corners", enabled=True)
    return shown


def tetrahedralize(V: ArrayLike, F: ArrayLike, **settings: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Tetrahedra within a closed surface, by fTetWild through pytetwild, whose settings these are
    (`edge_length_fac=0.05`, `epsilon=1e-3`, ...). The surface is met within `epsilon` of its diagonal, not vertex by
    vertex.

    Returns positions (n, 3) and tetrahedra (m, 4) of positive volume, as `deform` takes them. Raises InputError where
    pytetwild makes none, SolveError where it fails.

    Hu, Schneider, Wang, Zorin and Panozzo 2020.
    """
    pytetwild = extra("pytetwild", "tetwild", "tetrahedralize")
    points = _arrays.points(V)
    triangles = np.ascontiguousarray(_arrays.elements(F, [3], "F", "face"), dtype=np.int32)
    if triangles.size and int(triangles.max()) >= len(points):
        raise InputError(f"F: vertex {int(triangles.max())} does not exist; there are {len(points)} (0-based)")
    X, cells = pytetwild.tetrahedralize(points, triangles, **{"quiet": True, **settings})
    X, T = np.asarray(X, dtype=np.float64), np.asarray(cells, dtype=np.int64)
    if len(T) == 0:
        raise InputError("V, F: fTetWild found no inside; give a closed surface with faces that point outwards")
    # Its order of corners is another in some versions; which one is seen from the signs.
    edges = X[T[:, 1:]] - X[T[:, :1]]
    turned = np.linalg.det(edges) < 0
    T[turned] = T[turned][:, [0, 2, 1, 3]]
    return X, T


def gradient_operator(V: ArrayLike, T: ArrayLike) -> Any:
    """The sparse G (3 m, n) of deformation gradients of tetrahedra: with X (n, 3) positions, rows 3 e to 3 e + 2 of
    G X are the transpose of F = dx/dX of tetrahedron e, so that (G V) is identities, one below the other.

    A `scipy.sparse.csr_matrix`. Raises InputError for a tetrahedron without volume.
    """
    sparse = extra("scipy.sparse", "scipy", "gradient_operator")
    points = _arrays.points(V)
    cells = _arrays.elements(T, [4], "T", "tetrahedron").astype(np.int64)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]  # rows are the edges
    volumes = np.linalg.det(edges)
    if (volumes == 0.0).any():
        raise InputError(
            f"T: tetrahedron {int(np.flatnonzero(volumes == 0.0)[0])} (0-based) has no volume; leave it out"
        )
    inverse = np.linalg.inv(edges)  # columns are the gradients of the last three corners' hat functions
    hats = np.concatenate([-inverse.sum(2, keepdims=True), inverse], axis=2)  # (m, 3, 4)
    m = len(cells)
    rows = np.broadcast_to(np.arange(3 * m).reshape(m, 3, 1), hats.shape)
    columns = np.broadcast_to(cells[:, None, :], hats.shape)
    return sparse.csr_matrix((hats.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * m, len(points)))


def cotangent_laplacian(V: ArrayLike, F: ArrayLike) -> Any:
    """The sparse stiffness matrix L (n, n) of a triangle mesh, symmetric and positive semidefinite: x^T L x is the
    Dirichlet energy, integral of |grad x|^2; off the diagonal -(cot a + cot b)/2.

    A `scipy.sparse.csr_matrix`. Raises InputError for a triangle without area. Pinkall and Polthier 1993.
    """
    sparse = extra("scipy.sparse", "scipy", "cotangent_laplacian")
    points = _arrays.points(V)
    corners = _arrays.elements(F, [3], "F", "face").astype(np.int64)
    n = len(points)
    total = sparse.csr_matrix((n, n))
    for k in range(3):
        i, j, o = corners[:, k], corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]
        a, b = points[i] - points[o], points[j] - points[o]
        double_area = np.linalg.norm(np.cross(a, b), axis=1)
        if (double_area == 0.0).any():
            raise InputError(
                f"F: face {int(np.flatnonzero(double_area == 0.0)[0])} (0-based) has no area; leave it out"
            )
        half = 0.5 * (a * b).sum(1) / double_area
        values, rows, columns = np.r_[half, half, -half, -half], np.r_[i, j, i, j], np.r_[i, j, j, i]
        total = total + sparse.csr_matrix((values, (rows, columns)), shape=(n, n))
    return total
