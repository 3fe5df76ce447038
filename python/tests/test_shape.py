"""Constraints, distances, images, wavefronts: against formulas in numpy and what is known."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import patch, quads, sphere

import proxel


def planarity(X, Q):
    """The largest distance of the corners of each face from their best plane: the last singular direction."""
    corners = X[Q] - X[Q].mean(1, keepdims=True)
    normals = np.linalg.svd(corners)[2][:, -1]
    return np.abs((corners * normals[:, None]).sum(2)).max(1)


def edges(Q):
    ends = np.concatenate([Q[:, [k, (k + 1) % Q.shape[1]]] for k in range(Q.shape[1])])
    return np.unique(np.sort(ends, 1), axis=0)


def test_faces_become_planar(tmp_path):
    V, _ = patch(10)
    Q = quads(10)
    X, info = proxel.planarize(V, Q)
    e = edges(Q)
    mean = np.linalg.norm(V[e[:, 0]] - V[e[:, 1]], axis=1).mean()
    assert info.status == "converged" and info.mean_edge == pytest.approx(mean)
    assert planarity(V, Q).max() / mean > 1e-3 and planarity(X, Q).max() / mean < 1e-9
    assert info.planarity_max["before"] == pytest.approx(planarity(V, Q).max() / mean, rel=1e-6)
    assert info.planarity.shape == (len(Q),) and info.distance.shape == (len(V),)
    # Vertices slide along the reference and stay near to it.
    assert info.distance.max() < 0.1
    assert info.distance.max() / mean == pytest.approx(info.reference_distance_max["after"])
    info.save_preview(tmp_path / "planar.png")


def test_edges_become_of_one_length():
    V, _ = patch(8)
    Q = quads(8)
    X, info = proxel.wire(V, Q, edge_length=0.24)
    e = edges(Q)
    np.testing.assert_allclose(np.linalg.norm(X[e[:, 0]] - X[e[:, 1]], axis=1), 0.24, rtol=1e-8)
    a, b = X[np.roll(Q, 1, 1)] - X[Q], X[np.roll(Q, -1, 1)] - X[Q]
    cosines = (a * b).sum(2) / np.linalg.norm(a, axis=2) / np.linalg.norm(b, axis=2)
    angles = np.degrees(np.arccos(cosines))
    assert angles.min() > 45 - 1e-6 and angles.max() < 135 + 1e-6
    np.testing.assert_array_equal(info.faces, Q)
    X, info = proxel.wire(V, Q, subdivide=1)
    assert info.faces.shape == (4 * len(Q), 4) and len(X) == (2 * 8 + 1) ** 2


def test_a_recipe(tmp_path):
    V, _ = patch(8)
    Q = quads(8)
    recipe = {
        "select": {"corners": [0, 8, 72, 80]},
        "constraint": [
            {"kind": "planar"},
            {"kind": "fixed", "vertices": "corners"},
            {"kind": "near", "weight": 1.0},
        ],
    }
    X, info = proxel.shape(V, Q, recipe)
    assert info.status == "converged" and planarity(X, Q).max() < 1e-9
    np.testing.assert_array_equal(X[[0, 8, 72, 80]], V[[0, 8, 72, 80]])
    assert [c["kind"] for c in info.constraints] == ["planar", "fixed", "near"]
    path = tmp_path / "recipe.toml"
    path.write_text('mesh = "any.obj"\n[[constraint]]\nkind = "planar"\n[[constraint]]\nkind = "near"\nweight = 1\n')
    X, info = proxel.shape(V, Q, path, mu=1e4)
    assert planarity(X, Q).max() < 1e-9 and info.settings["mu"] == 1e4
    with pytest.raises(proxel.InputError, match="flat"):
        proxel.shape(V, Q, {"constraint": [{"kind": "flat"}]})


def test_distances_on_a_plane_and_a_sphere(tmp_path):
    V, F = patch(40, 0.0)
    d, info = proxel.geodesic(V, F, [0])
    exact = np.linalg.norm(V - V[0], axis=1)
    assert info.status == "converged" and np.abs(d - exact).max() < 0.03 * exact.max()
    assert d[0] == pytest.approx(0, abs=1e-12) and info.distance_max == pytest.approx(d.max())
    V, F = sphere(4)
    d, info = proxel.geodesic(V, F, 0)
    assert np.abs(d - np.arccos(np.clip(V[:, 0], -1, 1))).max() < 0.1
    info.save_preview(tmp_path / "distance.png")
    both = np.r_[V, V + [5, 0, 0]]
    d, info = proxel.geodesic(both, np.r_[F, F + len(V)], [0], method="admm", trace=True)
    assert np.isinf(d[len(V) :]).all() and info.unreached_vertices == len(V) and len(info.trace) > 1


def total_variation(u):
    """Of an image that goes on periodically."""
    return np.sqrt((np.roll(u, -1, 0) - u) ** 2 + (np.roll(u, -1, 1) - u) ** 2).sum()


def blocks(n=48):
    i, j = np.indices((n, n))
    return np.where((i // 12 + j // 12) % 2, 0.25, 0.75)


def test_noise_goes():
    truth = blocks()
    noisy = truth + 0.06 * np.random.default_rng(3).standard_normal(truth.shape)
    out, info = proxel.denoise(noisy, lambda_=10.0, truth=truth, tol=1e-6, boundary="periodic")
    assert info.lambda_ == info.to_dict()["lambda"] == 10.0
    assert info.status == "converged" and out.shape == truth.shape and info.relative_gap <= 1e-6
    assert info.settings["lambda"] == 10.0
    # The objective that A(31) has in numpy, and that no step improves it.
    objective = lambda u: total_variation(u) + 10.0 * ((u - noisy) ** 2).sum()
    assert info.energy == pytest.approx(objective(out), rel=1e-10)
    rng = np.random.default_rng(0)
    for size in (1e-2, 1e-3):
        assert objective(out + size * rng.standard_normal(out.shape)) > objective(out) * (1 - 1e-6)
    rms = lambda u: np.sqrt(((u - truth) ** 2).mean())
    assert info.psnr == pytest.approx(-20 * np.log10(rms(out)), abs=1e-6) and rms(out) < 0.6 * rms(noisy)
    colours, _ = proxel.denoise(np.stack([noisy] * 3, 2).astype(np.float32), lambda_=10.0)
    assert colours.shape == (48, 48, 3)


def test_blur_and_holes():
    truth = blocks()
    psf = np.ones((5, 5)) / 25
    blurred = sum(np.roll(truth, (i, j), (0, 1)) for i in range(-2, 3) for j in range(-2, 3)) / 25
    rms = lambda u: np.sqrt(((u - truth) ** 2).mean())
    out, info = proxel.deblur(blurred, psf, lambda_=5000.0, boundary="periodic")
    assert rms(out) < 0.25 * rms(blurred)
    named, _ = proxel.deblur(blurred, "disk:2.5", lambda_=500.0)
    assert named.shape == truth.shape
    mask = np.random.default_rng(1).random(truth.shape) > 0.3
    out, info = proxel.inpaint(np.where(mask, truth, 0.0), mask, lambda_=1e3)
    assert rms(out) < 0.25 * rms(np.where(mask, truth, 0.0))
    for psf, text in (("box:3", "box:3"), ("gaussian:x", "gaussian:S"), (np.zeros((3, 3)), "sum")):
        with pytest.raises(proxel.InputError, match=text):
            proxel.deblur(truth, psf)
    with pytest.raises(proxel.InputError, match="mask"):
        proxel.inpaint(truth, mask[:10])


def test_a_wavefront():
    """An image seen through a known, smooth shift: captured(p + grad phi(p)) = reference(p)."""
    from scipy.ndimage import map_coordinates

    n = 96
    i, j = np.indices((n, n)).astype(float)
    rng = np.random.default_rng(5)
    texture = np.kron(rng.random((n // 3 + 8, n // 3 + 8)), np.ones((3, 3)))
    w = 2 * np.pi / n
    phi = 20.0 * np.cos(w * i) * np.cos(w * j)
    shift = (-20.0 * w * np.sin(w * i) * np.cos(w * j), -20.0 * w * np.cos(w * i) * np.sin(w * j))
    captured = 255 * texture[:n, :n]
    from scipy.ndimage import gaussian_filter

    captured = gaussian_filter(captured, 1.5)
    reference = map_coordinates(captured, [i + shift[0], j + shift[1]], order=3, mode="nearest")
    found, info = proxel.wavefront(reference, captured)
    assert found.shape == (n, n) and abs(found.mean()) < 1e-9
    inner = np.s_[8:-8, 8:-8]
    off = (found - phi)[inner]
    assert np.std(off) < 0.15 * np.std(phi[inner])
    assert info.phi_rms == pytest.approx(np.sqrt((found**2).mean()), rel=1e-9)
