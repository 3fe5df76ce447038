"""Problems put together by hand: those of the built-in commands, where they are the same."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import beam, patch, quads

import proxel


def planes(rows):
    """The nearest planar quads: without the part along the last right singular vector."""
    _, _, W = np.linalg.svd(rows, full_matrices=False)
    n = W[:, -1]
    return rows - np.einsum("mkd,md,me->mke", rows, n, n)


def warped():
    V, _ = patch(7)
    return V + np.c_[np.zeros((64, 2)), 0.2 * V[:, 0] * V[:, 1]], quads(7)


@pytest.mark.parametrize("iterations", [1, 40])
def test_planarity_in_numpy_is_that_of_planarize(iterations):
    V, Q = warped()
    settings = dict(method="admm", tol=1e-14, max_iters=iterations)
    built_in, told = proxel.planarize(V, Q, mu=10.0, **settings)
    problem = proxel.Problem(V).near(np.arange(64), (V, Q), 1.0).fairing(Q, 0.1).project(Q, planes, weight=10.0)
    own, info = problem.solve(**settings)
    assert info.iterations == told.iterations == iterations and info.method == "admm"
    np.testing.assert_allclose(own, built_in, rtol=0, atol=1e-9)
    assert np.abs(own - V).max() > 1e-3


def test_it_converges_and_tells_how_far_sets_are():
    V, Q = warped()
    problem = proxel.Problem(V).springs(np.arange(64), V, 1.0).project(Q, planes, weight=10.0).fix([0, 7])
    X, info = problem.solve(trace=True)
    assert info.status == "converged" and info.method == "aa-admm" and info.violation < 1e-6
    rows = X[Q] - X[Q].mean(1, keepdims=True)
    assert np.abs(rows - planes(rows)).max() < 1e-6
    np.testing.assert_array_equal(X[[0, 7]], V[[0, 7]])
    assert len(info.trace) == info.iterations + 1


def test_soft_spheres_have_a_known_minimum():
    """w/2 (|x| - 1)^2 + k/2 |x - t|^2 along t: |x| = (w + k |t|) / (w + k)."""
    t = np.random.default_rng(0).standard_normal((20, 3)) + [3.0, 0, 0]
    sphere = lambda rows: rows / np.linalg.norm(rows, axis=-1, keepdims=True)
    problem = proxel.Problem(t).springs(np.arange(20), t, 0.5)
    problem.project(np.arange(20)[:, None], sphere, hard=False, weight=2.0, centred=False)
    length = np.linalg.norm(t, axis=1, keepdims=True)
    expected = t / length * (2.0 + 0.5 * length) / 2.5
    for method in ("lbfgs", "aa-admm", "admm"):
        X, info = problem.solve(method=method, tol=1e-10)
        assert info.status == "converged"
        np.testing.assert_allclose(X, expected, atol=1e-7)


def test_energies_built_in_and_own():
    V, T = beam((3, 2, 2), (1.5, 1.0, 1.0))
    ends = np.flatnonzero((V[:, 0] == 0) | (V[:, 0] == 1.5))
    targets = V[ends] * [1.2, 1.0, 1.0] + 0.1 * V[ends][:, [1, 2, 0]]

    def arap(F, mu=2e2):
        U, _, W = np.linalg.svd(F)
        U[np.linalg.det(U @ W) < 0, :, -1] *= -1
        d = F - U @ W
        return mu * (d**2).sum((1, 2)), 2 * mu * d

    like = dict(material="arap", mu=2e2, lambda_=0.0)
    expected, _ = proxel.deform(V, T, pins=ends, targets=targets, **like)
    built_in, info = proxel.Problem(V).fix(ends, targets).elastic(T, **like).solve()
    assert info.method == "newton" and info.status == "converged"
    own, told = proxel.Problem(V).fix(ends, targets).energy(T, arap, **like).solve()
    assert told.method == "lbfgs" and told.status == "converged"
    np.testing.assert_allclose(built_in, expected, atol=1e-6)
    np.testing.assert_allclose(own, expected, atol=1e-6)
    forces = proxel.Problem(V).fix(ends, targets).elastic(T, **like).forces([20], [[1.0, 2.0, 3.0]]).solve()[0]
    assert np.abs(forces - built_in).max() > 1e-4


def test_what_a_projection_does_wrong_is_told():
    V, Q = warped()
    problem = lambda f: proxel.Problem(V).near(np.arange(64), (V, Q), 1.0).project(Q, f)

    def raises(rows):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        problem(raises).solve()
    with pytest.raises(proxel.InputError, match=r"shape \(49, 3\)"):
        problem(lambda rows: rows[:, 0]).solve()
    with pytest.raises(proxel.InputError, match="element 5"):
        problem(lambda rows: np.where(np.arange(49)[:, None, None] == 5, np.nan, rows)).solve()
    with pytest.raises(proxel.InputError, match="lbfgs cannot take hard sets"):
        problem(planes).solve(method="lbfgs")
    with pytest.raises(proxel.InputError, match="names point 64"):
        proxel.Problem(V).project([[0, 1, 64]], planes).solve()
    with pytest.raises(proxel.InputError, match="no `yung`"):
        proxel.Problem(V).elastic(Q[:, :3], yung=1.0)
    with pytest.raises(proxel.InputError, match="no setting `mu`"):
        problem(planes).solve(mu=1.0)
    heard = []
    _, info = problem(planes).solve(callback=lambda p: heard.append(p.energy) or p.iteration >= 2)
    assert info.status == "cancelled" and len(heard) == 3
