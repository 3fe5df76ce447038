"""Energies written in numpy: against the built-in ones, by the same method."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import beam, patch

import proxel

V, T = beam()
ENDS = np.flatnonzero((V[:, 0] == 0) | (V[:, 0] == 3))
TARGETS = np.where(V[ENDS, :1] == 0, V[ENDS], V[ENDS] + [0.4, 0.1, -0.3])
MU, LAMBDA = 2e5, 3e5


def arap(F):
    """mu |F - R|^2 with R the rotation nearest to F, and 2 mu (F - R)."""
    U, _, W = np.linalg.svd(F)
    U[np.linalg.det(U @ W) < 0, :, -1] *= -1
    d = F - U @ W
    return MU * (d**2).sum((1, 2)), 2 * MU * d


def neo_hookean(F):
    """mu/2 (|F|^2 - 3) - mu log J + lambda/2 log^2 J"""
    J = np.linalg.det(F)
    with np.errstate(invalid="ignore", divide="ignore"):
        log = np.log(J)
    psi = MU / 2 * ((F**2).sum((1, 2)) - 3) - MU * log + LAMBDA / 2 * log**2
    P = MU * F + (LAMBDA * log - MU)[:, None, None] * np.linalg.inv(F).transpose(0, 2, 1)
    return np.where(J > 0, psi, np.inf), P


neo_hookean.barrier = True


@pytest.mark.parametrize("method", ["lbfgs", "bcqn"])
@pytest.mark.parametrize("energy", [arap, neo_hookean])
def test_an_energy_in_numpy_gives_what_the_built_in_one_gives(energy, method):
    name = energy.__name__.replace("_", "-")
    settings = {"material": name, "mu": MU, "lambda_": LAMBDA, "method": method, "tol": 1e-11}
    X, info = proxel.deform(V, T, pins=ENDS, targets=TARGETS, **settings)
    Y, told = proxel.deform(V, T, pins=ENDS, targets=TARGETS, energy=energy, **settings)
    assert info.status == told.status == "converged"
    np.testing.assert_allclose(Y, X, atol=1e-9 * 3)
    assert told.energy == pytest.approx(info.energy, rel=1e-11)
    np.testing.assert_allclose(told.reaction, info.reaction, atol=1e-6 * MU)
    assert told.inverted == 0 and told.min_stretch == pytest.approx(info.min_stretch, abs=1e-8)


def test_gradients_come_in_the_order_of_the_tetrahedra():
    """An energy that differs from element to element."""
    seen = []
    stiff = np.where(V[T].mean(1)[:, 0] < 1.5, 1.0, 100.0)

    def energy(F):
        seen.append(F)
        psi, P = arap(F)
        return stiff * psi, stiff[:, None, None] * P

    X, info = proxel.deform(V, T, pins=ENDS, targets=V[ENDS] + [[0.6, 0, 0]] * (V[ENDS, :1] > 0), energy=energy,
                            method="lbfgs", material="arap", mu=MU, lambda_=0.0)
    assert info.status == "converged" and seen[0].shape == (len(T), 3, 3)
    assert (X[V[:, 0] == 1.5, 0] - 1.5).mean() > 0.5
    rest = np.stack([V[T[:, k]] - V[T[:, 0]] for k in (1, 2, 3)], axis=2)
    now = np.stack([X[T[:, k]] - X[T[:, 0]] for k in (1, 2, 3)], axis=2)
    expected = (energy(now @ np.linalg.inv(rest))[0] * np.linalg.det(rest) / 6).sum()
    assert info.energy == pytest.approx(expected, rel=1e-12)


def test_what_goes_wrong_in_an_energy_is_raised(tmp_path):
    def run(energy, **settings):
        return proxel.deform(V, T, pins=ENDS, targets=TARGETS, energy=energy, **{"method": "lbfgs", **settings})

    calls = []

    def fails(F):
        calls.append(1)
        if len(calls) == 3:
            raise ZeroDivisionError("mine")
        return arap(F)

    with pytest.raises(ZeroDivisionError, match="mine"):
        run(fails)
    assert len(calls) == 3
    with pytest.raises(proxel.InputError, match=r"energy: psi is \(3,\)"):
        run(lambda F: (np.zeros(3), F))
    with pytest.raises(proxel.InputError, match="returned no pair"):
        run(lambda F: 1.0)
    with pytest.raises(proxel.InputError, match="use --method lbfgs or bcqn"):
        run(arap, method="auto")
    with pytest.raises(proxel.InputError, match="tetrahedra"):
        proxel.deform(*patch(4), energy=arap, method="lbfgs", surface="shell")
    with pytest.raises(proxel.InputError, match="no picture"):
        run(arap)[1].save_preview(tmp_path / "pose.png")
