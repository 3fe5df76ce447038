"""Meshes of other packages: what goes out comes in again, and sparse operators against their definitions."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import beam, patch, quads, sphere

import proxel
from proxel import interop


def test_files_by_numpy_alone(tmp_path):
    V, F = patch(3)
    mixed = [[0, 1, 5, 4], [1, 2, 6], [1, 6, 5]]
    np.savez(tmp_path / "a.npz", V=V, F=F)
    obj = (
        "".join(f"v {x!r} {y!r} {z!r} 1 0 0\n" for x, y, z in V.tolist())
        + "vt 0 0\nf 1/1 2/1/1 6//1 5\nf -15 3 7\nf 2 7 6\n"
    )
    (tmp_path / "b.obj").write_text(obj)
    off = f"OFF # a comment\n{len(V)} 3 0\n\n" + "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in V.tolist())
    (tmp_path / "c.off").write_text(off + "4 0 1 5 4\n3 1 2 6 255 0 0\n3 1 6 5\n")
    for name, expected in [("a.npz", F.tolist()), ("b.obj", mixed), ("c.off", mixed)]:
        v, f = interop.faces(tmp_path / name)
        np.testing.assert_array_equal(v, V)
        assert [list(face) for face in f] == expected
    np.savez(tmp_path / "d.npz", V=beam()[0], T=beam()[1])
    np.testing.assert_array_equal(interop.tets(tmp_path / "d.npz")[1], beam()[1])
    for name, text, message in [
        ("x.obj", "v 0 0 0\nv 1 0\n", "line 2"),
        ("x.obj", "v 0 0 0\nf 1 1 0\n", "line 2: a face has three corners or more, and no corner 0"),
        ("x.obj", "v 0 0 0\n", "it has no face"),
        ("x.obj", "v 0 0 0\nf 1 -3 1\n", "line 2"),
        ("x.off", "COFF\n1 1 1\n", "line 1: it does not begin with OFF"),
        ("x.off", "OFF\n2 1 0\n0 0 0\n", "it ends after line 3"),
        ("x.off", "OFF\n1 1 0\n0 0 0\n3 0 0\n", "line 4: a face of 3 corners has 2"),
        ("x.npz", "no archive", "it is no archive of arrays"),
        ("nowhere.obj", None, "cannot be read"),
    ]:
        if text is not None:
            (tmp_path / name).write_text(text)
        with pytest.raises(proxel.InputError, match=message) as caught:
            interop.faces(tmp_path / name)
        assert name in str(caught.value)
    with pytest.raises(proxel.InputError, match="no tetrahedra"):
        interop.tets(tmp_path / "a.npz")
    with pytest.raises(proxel.InputError, match="builtins.int is no mesh"):
        interop.faces(1)


def test_what_is_not_installed_says_how_to_have_it(monkeypatch):
    import sys

    for module, call in [
        ("trimesh", lambda: interop.to_trimesh(*patch(2))),
        ("pyvista", lambda: interop.to_pyvista(*patch(2))),
        ("polyscope", lambda: interop.to_polyscope("a", *patch(2))),
        ("meshio", lambda: interop.faces("a.vtu")),
    ]:
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(proxel.InputError, match=rf"needs {module}; pip install 'proxel\[{module}\]'"):
            call()


def test_trimesh():
    trimesh = pytest.importorskip("trimesh")
    V, F = patch(4)
    mesh = interop.to_trimesh(V, F)
    assert isinstance(mesh, trimesh.Trimesh)
    v, f = interop.faces(mesh)
    np.testing.assert_array_equal(v, V)
    np.testing.assert_array_equal(f, F)
    np.testing.assert_array_equal(proxel.unwrap(v, f)[0], proxel.unwrap(V, F)[0])
    assert len(interop.to_trimesh(V, quads(4)).faces) == len(F)

    # A map with seams: each corner has the texture coordinates and the place that it had.
    S, G = sphere(2)
    uv, info = proxel.unwrap(S, G)
    assert len(uv) > len(S)
    mesh = interop.to_trimesh(S, G, uv, info.uv_faces)
    np.testing.assert_allclose(mesh.triangles, S[G], atol=0)
    np.testing.assert_array_equal(mesh.visual.uv[mesh.faces], uv[info.uv_faces])
    with pytest.raises(proxel.InputError, match="a face is not mapped"):
        interop.to_trimesh(S, G, uv, np.where(info.uv_faces == 0, -1, info.uv_faces))


def test_meshio(tmp_path):
    meshio = pytest.importorskip("meshio")
    V, T = beam((2, 1, 1))
    mesh = interop.to_meshio(V, T=T, point_data={"height": V[:, 2]})
    assert isinstance(mesh, meshio.Mesh)
    for name in ("a.vtu", "a.msh", "a.mesh"):
        mesh.write(tmp_path / name)
        v, t = interop.tets(tmp_path / name)
        np.testing.assert_allclose(v, V, atol=1e-15)
        np.testing.assert_array_equal(t, T)
    V, F = patch(2)
    mixed = [list(F[0]), list(F[1]), [0, 1, 4, 3]]
    v, f = interop.faces(interop.to_meshio(V, mixed))
    assert f == mixed
    interop.to_meshio(V, F).write(tmp_path / "b.stl")
    v, f = interop.faces(tmp_path / "b.stl")
    np.testing.assert_allclose(v[f], V[F], atol=1e-7)  # STL has numbers of single precision
    (tmp_path / "c.stl").write_text("nothing")
    with pytest.raises(proxel.InputError, match="c.stl: meshio cannot read it"):
        interop.faces(tmp_path / "c.stl")
    with pytest.raises(proxel.InputError, match="neither faces nor tetrahedra"):
        interop.to_meshio(V)


def test_pyvista():
    pytest.importorskip("pyvista")
    V, F = patch(4)
    uv, _ = proxel.unwrap(V, F)
    mesh = interop.to_pyvista(V, F, point_data={"height": V[:, 2]}, uv=uv)
    assert mesh.n_cells == len(F) and mesh["height"].shape == (len(V),)
    np.testing.assert_allclose(mesh.active_texture_coordinates, uv)
    np.testing.assert_array_equal(interop.faces(mesh)[1], F)
    body = beam((2, 1, 1))
    grid = interop.to_pyvista(body[0], T=body[1])
    np.testing.assert_allclose(grid.volume, 3.0)
    for got, expected in zip(interop.tets(grid), body):
        np.testing.assert_array_equal(got, expected)


def test_polyscope(tmp_path, monkeypatch):
    polyscope = pytest.importorskip("polyscope")
    monkeypatch.chdir(tmp_path)
    polyscope.set_use_prefs_file(False)  # it leaves its settings where it is started
    polyscope.init("openGL_mock")
    S, G = sphere(1)
    uv, info = proxel.unwrap(S, G)
    shown = interop.to_polyscope("sphere", S, G, point_data={"z": S[:, 2], "normal": S}, uv=uv, uv_faces=info.uv_faces)
    assert shown.n_vertices() == len(S) and shown.n_faces() == len(G)
    assert interop.to_polyscope("body", beam()[0], T=beam()[1]).n_cells() == len(beam()[1])


def test_tetrahedra_of_a_surface(tmp_path, monkeypatch):
    pytest.importorskip("pytetwild")
    monkeypatch.chdir(tmp_path)  # fTetWild leaves a file where it is started
    S, G = sphere(2)
    V, T = interop.tetrahedralize(S, G, edge_length_fac=0.3)
    volumes = np.linalg.det(V[T[:, 1:]] - V[T[:, :1]]) / 6
    inside = np.linalg.det(S[G]).sum() / 6
    assert (volumes > 0).all() and abs(volumes.sum() / inside - 1) < 0.02
    held = np.flatnonzero(V[:, 2] < -0.5)
    X, info = proxel.deform(V, T, pins=held, forces=np.full(V.shape, 1.0), young=1e5)
    assert info.status == "converged" and info.inverted == 0
    with pytest.raises(proxel.InputError, match="vertex 99 does not exist"):
        interop.tetrahedralize(S[:10], np.where(G == 3, 99, G % 10))


def test_sparse_operators():
    pytest.importorskip("scipy")
    V, T = beam()
    G = interop.gradient_operator(V, T)
    np.testing.assert_allclose((G @ V).reshape(-1, 3, 3), np.broadcast_to(np.eye(3), (len(T), 3, 3)), atol=1e-12)
    A = np.array([[1.1, 0.3, -0.2], [0.0, 0.9, 0.4], [0.1, -0.5, 1.3]])
    F = (G @ (V @ A.T + [1, 2, 3])).reshape(-1, 3, 3).transpose(0, 2, 1)
    np.testing.assert_allclose(F, np.broadcast_to(A, F.shape), atol=1e-12)

    # Against the definition, triangle by triangle: the gradient of a hat function is its height, turned.
    V, F = sphere(1)
    L = interop.cotangent_laplacian(V, F).toarray()
    expected = np.zeros_like(L)
    for face in F:
        normal = np.cross(V[face[1]] - V[face[0]], V[face[2]] - V[face[0]])
        area = np.linalg.norm(normal) / 2
        grads = [np.cross(normal, V[face[(k + 2) % 3]] - V[face[(k + 1) % 3]]) / (4 * area**2) for k in range(3)]
        expected[np.ix_(face, face)] += area * np.array(grads) @ np.array(grads).T
    np.testing.assert_allclose(L, expected, atol=1e-12)
    assert np.abs(L.sum(1)).max() < 1e-12 and np.linalg.eigvalsh(L)[0] > -1e-12
    with pytest.raises(proxel.InputError, match=r"face 1 \(0-based\) has no area"):
        interop.cotangent_laplacian(V, [F[0], [0, 0, 1]])
    with pytest.raises(proxel.InputError, match=r"tetrahedron 0 \(0-based\) has no volume"):
        interop.gradient_operator(V, [[0, 0, 1, 2]])
