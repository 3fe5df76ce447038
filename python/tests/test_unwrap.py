"""Maps: against formulas in numpy."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import patch, quads, sphere

import proxel


def distortion(V, F, uv, G):
    """Singular values of each triangle's Jacobian, and its signed area in the map."""
    e, f = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    normal = np.cross(e, f)
    x = e / np.linalg.norm(e, axis=1)[:, None]
    y = np.cross(normal / np.linalg.norm(normal, axis=1)[:, None], x)
    rest = np.stack([np.stack([(e * x).sum(1), (f * x).sum(1)], 1), np.stack([(e * y).sum(1), (f * y).sum(1)], 1)], 1)
    a, b = uv[G[:, 1]] - uv[G[:, 0]], uv[G[:, 2]] - uv[G[:, 0]]
    J = np.stack([a, b], axis=2) @ np.linalg.inv(rest)
    return np.linalg.svd(J, compute_uv=False), np.linalg.det(J), 0.5 * np.linalg.norm(normal, axis=1)


def symmetric_dirichlet(V, F, uv, G):
    """Area-weighted mean of (s^2 + t^2 + s^-2 + t^-2) / 4 at the scale of least energy: 1 for an isometry."""
    s, det, area = distortion(V, F, uv, G)
    assert (det > 0).all()
    area = area / area.sum()
    # Scaled by c, c^2 p + q / c^2 is least at 2 sqrt(p q).
    p, q = (area * (s**2).sum(1)).sum(), (area * (s**-2).sum(1)).sum()
    return 2 * np.sqrt(p * q) / 4


def test_the_energy_and_the_flips_are_those_of_numpy(surface):
    V, F = surface
    uv, info = proxel.unwrap(V, F)
    assert info.status == "converged" and info.flips == 0 and info.overlaps == 0 and info.charts == 1
    assert uv.shape == (len(V), 2) and uv.dtype == np.float64 and uv.flags.c_contiguous
    np.testing.assert_array_equal(info.uv_faces, F)
    assert info.uv_faces.dtype == np.int32
    assert info.energy == pytest.approx(symmetric_dirichlet(V, F, uv, F), rel=1e-9)
    assert 0 <= uv.min() and uv.max() <= 1


def test_it_is_a_minimum(surface):
    V, F = surface
    uv, info = proxel.unwrap(V, F, pack=False)
    least = symmetric_dirichlet(V, F, uv, F)
    rng = np.random.default_rng(1)
    for size in (1e-3, 1e-4):
        other = symmetric_dirichlet(V, F, uv + size * rng.standard_normal(uv.shape), F)
        assert other > least
    # Another method has the same minimum.
    slim, told = proxel.unwrap(V, F, method="slim", pack=False)
    assert told.status == "converged" and told.energy == pytest.approx(info.energy, rel=1e-7)


def test_a_closed_surface_is_cut(tmp_path):
    V, F = sphere()
    uv, info = proxel.unwrap(V, F)
    assert info.status == "converged" and info.flips == 0 and info.seam_length > 0
    assert len(uv) > len(V) and info.uv_faces.shape == F.shape and info.uv_faces.min() == 0
    assert info.uv_faces.max() == len(uv) - 1
    assert (distortion(V, F, uv, info.uv_faces)[1] > 0).all()
    info.save_preview(tmp_path / "uv.png")
    assert (tmp_path / "uv.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("points", [np.float32, np.float64, ">f8"])
@pytest.mark.parametrize("faces", [np.uint8, np.int16, np.int64, np.uint64, np.float64])
def test_any_type_and_order_gives_the_same(points, faces):
    V, F = patch(8)
    V = V.astype(np.float32).astype(np.float64)  # what every type holds
    expected, _ = proxel.unwrap(V, F)
    V, F = np.asfortranarray(V.astype(points)), np.asfortranarray(F.astype(faces))
    V.setflags(write=False)
    F.setflags(write=False)
    uv, info = proxel.unwrap(V, F)
    np.testing.assert_array_equal(uv, expected)
    # A view with steps, backwards.
    wide = np.zeros((len(V), 6), points)
    wide[:, ::2] = V
    np.testing.assert_array_equal(proxel.unwrap(wide[:, ::2], F[::-1][::-1])[0], expected)
    np.testing.assert_array_equal(proxel.unwrap(V.tolist(), F.tolist())[0], expected)


def test_nothing_is_renumbered_and_loose_vertices_stay():
    V, F = patch(8)
    V = np.r_[[[9.0, 9.0, 9.0]], V]
    uv, info = proxel.unwrap(V, F + 1)
    assert len(uv) == len(V) and np.isnan(uv[0]).all() and np.isfinite(uv[1:]).all()
    np.testing.assert_array_equal(info.uv_faces, F + 1)
    np.testing.assert_array_equal(uv[1:], proxel.unwrap(V[1:], F)[0])


def test_polygons():
    V, _ = patch(8)
    Q = quads(8)
    uv, info = proxel.unwrap(V, Q)
    np.testing.assert_array_equal(info.uv_faces, Q)
    ragged = [Q[0, [0, 1, 2]], Q[0, [0, 2, 3]], *Q[1:]]
    uv, info = proxel.unwrap(V, ragged)
    assert [len(face) for face in info.uv_faces] == [3, 3, *[4] * (len(Q) - 1)]
    assert all((a == b).all() for a, b in zip(info.uv_faces, ragged))
    # A surface in the plane is its own map.
    flat, info = proxel.unwrap(V[:, :2], Q)
    assert info.energy == pytest.approx(1.0, abs=1e-12)


def test_pins_seams_weights_and_a_start(surface):
    V, F = surface
    pins, targets = [0, 20, 440], np.array([[0.0, 0.0], [2.5, 0.0], [2.5, 2.0]])
    uv, info = proxel.unwrap(V, F, pins=pins, targets=targets)
    np.testing.assert_array_equal(uv[pins], targets)
    seams = np.c_[np.arange(5 * 21, 5 * 21 + 12), np.arange(5 * 21 + 1, 5 * 21 + 13)]
    uv, info = proxel.unwrap(V, F, seams=seams)
    assert len(uv) == len(V) + 12 and info.flips == 0  # the inner end of the cut is one vertex still
    uv, info = proxel.unwrap(V, F, pack=False)
    again, second = proxel.unwrap(V, F, start=uv, pack=False)
    assert second.iterations == 0
    weights = np.ones(len(F))
    weights[:50] = 100.0
    s = distortion(V, F, uv, F)[0]
    heavy = distortion(V, F, proxel.unwrap(V, F, weights=weights, pack=False)[0], F)[0]
    off = lambda s: (s**2 + s**-2).sum(1)[:50].mean()
    assert off(heavy) < off(s)


def test_an_unwrapper_goes_on_from_where_it_is(surface):
    V, F = surface
    expected, whole = proxel.unwrap(V, F, pack=False)
    unwrapper = proxel.Unwrapper(V, F, pack=False)
    first = unwrapper.step()
    assert first.iteration == 1 and first.open == 1
    uv, info = unwrapper.solve()
    assert info.status == "converged" and info.flips == 0
    assert info.energy == pytest.approx(whole.energy, rel=1e-9)
    again, info = unwrapper.solve()
    assert info.iterations == 0
    np.testing.assert_array_equal(again, uv)
    unwrapper.update_handles([0, 440], [[0.0, 0.0], [2.0, 2.0]])
    uv, info = unwrapper.solve()
    assert info.status == "converged" and info.iterations > 0
    np.testing.assert_array_equal(uv[[0, 440]], [[0.0, 0.0], [2.0, 2.0]])
    unwrapper.update_handles([], [])
    uv, info = unwrapper.solve()
    assert info.energy == pytest.approx(whole.energy, rel=1e-9)
    with pytest.raises(proxel.InputError, match="441"):
        unwrapper.update_handles([441], [[0.0, 0.0]])


def test_one_number_may_stand_for_all(surface):
    V, F = surface
    uv, _ = proxel.unwrap(V, F, weights=2.0)
    expected, _ = proxel.unwrap(V, F, weights=np.full(len(F), 2.0))
    np.testing.assert_array_equal(uv, expected)
