"""Mesh files for the Python side: NPZ, OBJ and OFF by numpy alone, others by meshio where it is installed.

The command line reads more, and more strictly. What is read here is what arrays can say: positions and elements, in the
order of the file.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._core import InputError
from ._extras import extra


class MeshFile(NamedTuple):
    """Positions (n, 3), faces (an array (m, k), or a list where sizes differ) and tetrahedra (m, 4); None where the
    file has none."""

    V: NDArray[np.float64]
    F: Any
    T: NDArray[np.int64] | None


def read_mesh(path: str | os.PathLike[str]) -> MeshFile:
    """Reads a mesh by its extension: .npz with the arrays V and F or T, .obj, .off; what else meshio knows, if that is
    there (`pip install 'proxel[meshio]'`).

    Raises InputError that names the file, the line where there are lines, and the remedy.
    """
    where = Path(path)
    ending = where.suffix.lower()
    try:
        if ending == ".npz":
            return _npz(where)
        if ending == ".obj":
            return _obj(where)
        if ending == ".off":
            return _off(where)
    except OSError as e:
        raise InputError(f"{where}: it cannot be read: {e.strerror or e}; check the path") from e
    except UnicodeDecodeError as e:
        raise InputError(f"{where}: it is no text in UTF-8; check that its extension is what it is") from e
    return _by_meshio(where)


def _faces(where: Path, faces: list[list[int]]) -> Any:
    if not faces:
        raise InputError(f"{where}: it has no face; give a mesh of faces")
    sizes = set(map(len, faces))
    return np.array(faces, dtype=np.int64) if len(sizes) == 1 else faces


def _npz(where: Path) -> MeshFile:
    try:
        with np.load(where, allow_pickle=False) as arrays:
            known = {k: arrays[k] for k in ("V", "F", "T") if k in arrays}
    except ValueError as e:
        raise InputError(f"{where}: it is no archive of arrays: {e}; write it by numpy.savez") from e
    if "V" not in known or len(known) < 2:
        raise InputError(f"{where}: it has not the arrays V and F or T; give positions and elements by these names")
    return MeshFile(known["V"], known.get("F"), known.get("T"))


def _obj(where: Path) -> MeshFile:
    points: list[list[float]] = []
    faces: list[list[int]] = []
    with where.open(encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            words = line.split()
            if not words or words[0] not in ("v", "f"):
                continue
            try:
                if words[0] == "v":
                    x, y, z = map(float, words[1:4])
                    points.append([x, y, z])
                else:
                    corners = [int(w.split("/")[0]) for w in words[1:]]
                    # 1-based, or negative from the last vertex so far.
                    faces.append([c - 1 if c > 0 else len(points) + c for c in corners])
                    if len(corners) < 3 or 0 in corners or min(faces[-1]) < 0:
                        raise ValueError("a face has three corners or more, and no corner 0")
            except ValueError as e:
                raise InputError(f"{where}: line {number}: {e}; correct the line") from e
    return MeshFile(np.array(points, dtype=np.float64).reshape(-1, 3), _faces(where, faces), None)


def _off(where: Path) -> MeshFile:
    def lines() -> Iterator[tuple[int, list[str]]]:
        with where.open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                words = line.split("#")[0].split()
                if words:
                    yield number, words

    rows = lines()
    number = 1
    try:
        number, words = next(rows)
        if words[0] != "OFF":
            raise ValueError("it does not begin with OFF")
        counts = words[1:]
        if not counts:
            number, counts = next(rows)
        n, m = int(counts[0]), int(counts[1])
        points = np.empty((n, 3))
        faces = []
        for k in range(n):
            number, words = next(rows)
            points[k] = [float(w) for w in words[:3]]
        for _ in range(m):
            number, words = next(rows)
            size = int(words[0])
            if len(words) <= size:
                raise ValueError(f"a face of {size} corners has {len(words) - 1}")
            faces.append([int(w) for w in words[1 : size + 1]])
    except (ValueError, IndexError) as e:
        raise InputError(f"{where}: line {number}: {e}; correct the line") from e
    except StopIteration:
        raise InputError(f"{where}: it ends after line {number}, before all that it announces; write it anew") from None
    return MeshFile(points, _faces(where, faces), None)


def _by_meshio(where: Path) -> MeshFile:
    meshio = extra("meshio", "meshio", f"{where}: what is not .npz, .obj or .off")
    if not where.is_file():
        raise InputError(f"{where}: there is no such file; check the path")
    try:
        mesh = meshio.read(where)
    # meshio ends the process on some errors of its own, and raises all kinds of exceptions on others.
    except (Exception, SystemExit) as e:
        raise InputError(f"{where}: meshio cannot read it: {e or type(e).__name__}; check the file") from e
    return of_meshio(mesh, str(where))


def of_meshio(mesh: Any, where: str) -> MeshFile:
    """The linear faces and tetrahedra of a `meshio.Mesh`, block by block in its order."""
    V = np.asarray(mesh.points, dtype=np.float64)
    if V.ndim == 2 and V.shape[1] == 2:
        V = np.c_[V, np.zeros(len(V))]
    tets = [np.asarray(c.data, dtype=np.int64) for c in mesh.cells if c.type == "tetra"]
    faces = [np.asarray(c.data, dtype=np.int64) for c in mesh.cells if c.type in ("triangle", "quad", "polygon")]
    if not tets and not faces:
        kinds = sorted({c.type for c in mesh.cells})
        raise InputError(f"{where}: it has cells of type {', '.join(kinds) or 'none'}; give triangles, quads or tetra")
    F: Any = None
    if faces:
        same = len({f.shape[1] for f in faces}) == 1
        F = np.concatenate(faces) if same else [row.tolist() for block in faces for row in block]
    return MeshFile(V, F, np.concatenate(tets) if tets else None)
