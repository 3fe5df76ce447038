"""Bodies: against formulas in numpy and scipy."""

from __future__ import annotations

import numpy as np
import pytest

import proxel


def held(V):
    """Both ends of a beam: the left stays, the right is moved and turned."""
    left, right = np.flatnonzero(V[:, 0] == 0), np.flatnonzero(V[:, 0] == V[:, 0].max())
    turn = np.array([[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]])
    targets = np.r_[V[left], V[right] @ turn.T + [0.3, 0.1, -0.2]]
    return np.r_[left, right], targets


def gradients(V, T, X):
    """Deformation gradients and rest volumes."""
    rest = np.stack([V[T[:, k]] - V[T[:, 0]] for k in (1, 2, 3)], axis=2)
    now = np.stack([X[T[:, k]] - X[T[:, 0]] for k in (1, 2, 3)], axis=2)
    return now @ np.linalg.inv(rest), np.linalg.det(rest) / 6


def neo_hookean(V, T, X, mu, lam):
    """mu/2 (I_1 - 3) - mu log J + lambda/2 log^2 J."""
    F, volume = gradients(V, T, X)
    J = np.linalg.det(F)
    assert (J > 0).all()
    return (volume * (mu / 2 * ((F**2).sum((1, 2)) - 3) - mu * np.log(J) + lam / 2 * np.log(J) ** 2)).sum()


def lame(young, poisson):
    return young / 2 / (1 + poisson), young * poisson / (1 + poisson) / (1 - 2 * poisson)


def test_energy_and_gradient_are_those_of_numpy(body):
    V, T = body
    pins, targets = held(V)
    X, info = proxel.deform(V, T, pins=pins, targets=targets, young=2e4, poisson=0.3)
    assert info.status == "converged" and info.inverted == 0 and info.method == "auto"
    assert X.shape == V.shape and X.dtype == np.float64 and X.flags.c_contiguous
    np.testing.assert_array_equal(X[pins], targets)
    mu, lam = lame(2e4, 0.3)
    energy = lambda X: neo_hookean(V, T, X, mu, lam)
    assert info.energy == pytest.approx(energy(X), rel=1e-10)
    # The slope along any direction of free vertices is 0; forces at pins are minus the gradient there.
    rng = np.random.default_rng(0)
    for _ in range(3):
        d = rng.standard_normal(X.shape)
        h = 1e-6
        slope = (energy(X + h * d) - energy(X - h * d)) / (2 * h)
        assert slope == pytest.approx(-(info.reaction * d).sum(), rel=1e-5, abs=1e-3)
        assert info.reaction[np.setdiff1d(np.arange(len(V)), pins)].max() == 0
    np.testing.assert_allclose(info.reaction.sum(0), 0, atol=1e-5 * np.abs(info.reaction).max())
    np.testing.assert_allclose(info.reactions["pins"], info.reaction[pins].sum(0))


def test_methods_agree_and_the_trace_falls(body):
    V, T = body
    pins, targets = held(V)
    X, info = proxel.deform(V, T, pins=pins, targets=targets, poisson=0.3)
    for method in ("wrapd", "newton", "lbfgs"):
        other, told = proxel.deform(V, T, pins=pins, targets=targets, poisson=0.3, method=method, trace=True)
        assert told.status == "converged" and told.method == method
        np.testing.assert_allclose(other, X, atol=1e-6)
        assert len(told.trace) == told.iterations + 1
        assert told.trace.energy[-1] == pytest.approx(told.energy, rel=1e-9)
        assert told.trace.iteration.tolist() == list(range(told.iterations + 1))
    assert info.trace is None


def test_a_uniform_stretch_of_arap_is_known(body):
    """All vertices of the border pinned to 1.5 V: F = 1.5 I everywhere, energy scale * 3 * 0.25 * volume."""
    V, T = body
    border = np.flatnonzero(((V == 0) | (V == V.max(0))).any(1))
    X, info = proxel.deform(V, T, pins=border, targets=1.5 * V[border], material="arap", mu=2.0, lambda_=0.0)
    np.testing.assert_allclose(X, 1.5 * V, atol=1e-8)
    assert info.energy == pytest.approx(3 * 0.25 * 2.0 * 3.0, rel=1e-9)  # mu |S - I|^2, volume 3


def test_types_orders_and_views_give_the_same(body):
    V, T = body
    pins, targets = held(V)
    expected, _ = proxel.deform(V, T, pins=pins, targets=targets)
    for kind in (np.uint8, np.int16, np.uint64, np.float32):
        view = np.asfortranarray(V)
        view.setflags(write=False)
        tets, places = np.asfortranarray(T.astype(kind)), targets[:, ::-1][:, ::-1]
        X, _ = proxel.deform(view, tets, pins=pins.astype(kind), targets=places)
        np.testing.assert_array_equal(X, expected)
    assert (proxel.deform(V, T, pins=pins, targets=targets, threads=1)[0] == expected).all()


def test_groups_forces_obstacles_and_regions(body):
    V, T = body
    groups = {
        "groups": {
            "left": {"plane": {"point": [0.1, 0, 0], "normal": [-1, 0, 0]}},
            "right": {"plane": {"point": [2.9, 0, 0], "normal": [1, 0, 0]}, "translate": [0.5, 0, 0]},
        }
    }
    X, info = proxel.deform(V, T, pins=groups)
    right = V[:, 0] == 3
    np.testing.assert_array_equal(X[right], V[right] + [0.5, 0, 0])
    assert set(info.reactions) == {"left", "right"}
    left = np.flatnonzero(V[:, 0] == 0)
    forces = np.zeros_like(V)
    forces[right] = [0, 0, -500.0]
    X, info = proxel.deform(V, T, pins=left, forces=forces, young=1e6)
    assert X[right, 2].mean() < V[right, 2].mean()
    np.testing.assert_allclose(info.reaction.sum(0), forces.sum(0), rtol=1e-6, atol=1e-4)
    floor, told = proxel.deform(V, T, pins=left, forces=forces, young=1e6, obstacles=[((0, 0, -0.001), (0, 0, 1))])
    assert X[:, 2].min() < -0.001 and floor[:, 2].min() >= -0.001 - 1e-9
    regions = np.where(V[T].mean(1)[:, 0] < 1.5, 1, 2)
    soft, _ = proxel.deform(
        V, T, pins=np.r_[left, np.flatnonzero(right)], targets=np.r_[V[left], V[right] + [0.6, 0, 0]],
        regions=regions, materials={1: {"young": 1e4}, 2: {"young": 1e6}},
    )
    middle = V[:, 0] == 1.5
    assert (soft[middle, 0] - 1.5).mean() > 0.5  # the soft half takes nearly all


def test_surfaces_and_the_plane():
    from conftest import patch, sphere

    V, F = sphere()
    settings = {"resolution": 8, "method": "wrapd", "tol": 1e-4}
    X, info = proxel.deform(V, F, pins=[0, 1], targets=[[1.3, 0, 0], [-1.3, 0, 0]], **settings)
    assert info.lattice["nodes"] > 0 and X.shape == V.shape
    V, F = patch(8, 0.0)
    edge = np.flatnonzero(np.abs(V[:, 0]) == 1)
    targets = V[edge, :2] * [1.2, 1.0]
    X, info = proxel.deform(V[:, :2], F, pins=edge, targets=targets, material="neo-hookean")
    assert info.status == "converged" and X.shape == (len(V), 2)
    np.testing.assert_array_equal(X[edge], targets)


def test_a_deformer_follows_its_handles(body):
    V, T = body
    pins, targets = held(V)
    deformer = proxel.Deformer(V, T, pins=pins, targets=V[pins], poisson=0.3)
    deformer.solve()
    deformer.update_handles(pins, targets)
    X, info = deformer.solve()
    expected, whole = proxel.deform(V, T, pins=pins, targets=targets, poisson=0.3)
    assert info.status == "converged"
    np.testing.assert_allclose(X, expected, atol=1e-7)
    np.testing.assert_array_equal(X, deformer.positions)
    np.testing.assert_array_equal(X[pins], targets)
    again, told = deformer.solve()
    assert told.iterations == 0
    deformer.move_group("pins", translation=[0, 0, 1])
    X, info = deformer.solve()
    np.testing.assert_allclose(X, V + [0, 0, 1], atol=1e-7)  # from where it was when the body was built
    with pytest.raises(proxel.InputError):
        deformer.update_handles([len(V)], [[0, 0, 0]])


def test_a_preview(body, tmp_path):
    V, T = body
    pins, targets = held(V)
    _, info = proxel.deform(V, T, pins=pins, targets=targets)
    info.save_preview(tmp_path / "pose.png")
    assert (tmp_path / "pose.png").stat().st_size > 1000
    with pytest.raises(proxel.InputError, match="png"):
        info.save_preview(tmp_path / "pose.jpg")
