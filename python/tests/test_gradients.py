"""Gradients through runs: against central differences of whole runs."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from conftest import beam, patch, sphere

import proxel

TIGHT = {"tol": 1e-11}


def difference(f, h=1e-3):
    """The derivative of f at 0, by four values."""
    return (f(-2 * h) - 8 * f(-h) + 8 * f(h) - f(2 * h)) / (12 * h)


def pulled():
    """A bar with its ends held, pulled and turned; a loss and its slope."""
    V, T = beam((4, 2, 2), (2.0, 1.0, 1.0))
    left, right = np.flatnonzero(V[:, 0] == 0), np.flatnonzero(V[:, 0] == 2)
    turn = np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    pins = np.r_[right, left]
    targets = np.r_[V[right] @ turn.T + [0.3, 0.1, 0.2], V[left]]
    weights = np.random.default_rng(1).standard_normal(V.shape)
    return V, T, pins, targets, weights


def test_a_bar_answers_to_all_that_it_was_given():
    V, T, pins, targets, weights = pulled()
    given = dict(pins=pins, targets=targets, young=3e4, poisson=0.3, forces=np.zeros_like(V), V=V)
    rng = np.random.default_rng(2)
    given["forces"][12] = [100, -200, 300]

    def solve(**changed):
        of = {**given, **changed}
        X, info = proxel.deform(of.pop("V"), T, **of, **TIGHT)
        assert info.status == "converged"
        return X, info

    X, info = solve()
    g = info.adjoint(weights + X)
    loss = lambda X: (weights * X).sum() + 0.5 * (X**2).sum()
    assert g.targets.shape == targets.shape and g.V.shape == V.shape and g.forces.shape == V.shape
    np.testing.assert_array_equal(g.pins, pins)
    assert g.distance < 1e-7 and g.materials == {}
    for name, scale in (("targets", 1.0), ("V", 0.3), ("forces", 1e3), ("young", 3e3), ("poisson", 0.3)):
        d = scale * rng.standard_normal(np.shape(given[name]))
        if name == "forces":
            d[pins] = 0
        slope = difference(lambda t: loss(solve(**{name: given[name] + t * d})[0]))
        assert (getattr(g, name) * d).sum() == pytest.approx(slope, rel=1e-5), name
    assert "young" in repr(g)


def test_the_plane_and_regions():
    V, F = patch(6, 0.0)
    edge = np.flatnonzero(np.abs(V).max(1) == 1)
    targets = V[edge, :2] * [1.2, 1.0] + 0.1 * V[edge, :1] ** 2
    regions = (V[F].mean(1)[:, 0] > 0).astype(int)
    given = dict(pins=edge, targets=targets, regions=regions, material="neo-hookean", young=1e4, **TIGHT)
    solve = lambda V, young: proxel.deform(V, F, materials={1: {"young": young, "poisson": 0.2}}, **given)
    X, info = solve(V[:, :2], 5e4)
    g = info.adjoint(X)
    assert g.V.shape == (len(V), 2) and g.targets.shape == targets.shape
    loss = lambda run: 0.5 * (run[0] ** 2).sum()
    slope = difference(lambda t: loss(solve(V[:, :2], 5e4 * (1 + t))))
    assert g.materials[1]["young"] * 5e4 == pytest.approx(slope, rel=1e-5)
    d = 0.1 * np.random.default_rng(0).standard_normal((len(V), 2))
    slope = difference(lambda t: loss(solve(V[:, :2] + t * d, 5e4)))
    assert (g.V * d).sum() == pytest.approx(slope, rel=1e-5)


def test_maps_answer_to_their_surface():
    V, F = patch(6)
    pairs = np.array([[0, 48], [6, 42], [3, 20]])
    span = lambda uv: ((uv[pairs[:, 0]] - uv[pairs[:, 1]]) ** 2).sum()
    solve = lambda V, **more: proxel.unwrap(V, F, pack=False, **more, **TIGHT)
    d = 0.2 * np.random.default_rng(3).standard_normal(V.shape)
    for more in ({}, {"pins": [0, 48], "targets": [[0.0, 0.0], [2.0, 2.2]]}):
        uv, info = solve(V, **more)
        slope = np.zeros_like(uv)
        np.add.at(slope, pairs[:, 0], 2 * (uv[pairs[:, 0]] - uv[pairs[:, 1]]))
        np.add.at(slope, pairs[:, 1], -2 * (uv[pairs[:, 0]] - uv[pairs[:, 1]]))
        g = info.adjoint(slope)
        expected = difference(lambda t: span(solve(V + t * d, **more)[0]))
        assert (g.V * d).sum() == pytest.approx(expected, rel=1e-5)
    assert g.targets.shape == (2, 2)
    e = np.array([[0.3, -0.1], [0.2, 0.4]])
    moved = lambda t: span(solve(V, pins=[0, 48], targets=np.array(more["targets"]) + t * e)[0])
    assert (g.targets * e).sum() == pytest.approx(difference(moved), rel=1e-5)


def test_a_pose_answers_to_its_targets():
    V, T, pins, targets, weights = pulled()
    forces = np.zeros_like(V)
    forces[12] = [100, -200, 300]
    given = dict(forces=forces, young=3e4, **TIGHT)
    live = proxel.Deformer(V, T, pins=pins, targets=targets, **given)
    _, first = live.solve()
    moved = targets + 0.1 * np.sin(np.arange(targets.size)).reshape(targets.shape)
    live.update_handles(pins, moved)
    X, info = live.solve()
    live.update_handles(pins, targets)  # what a pose has been asked for stays with its info
    live.solve()
    loss = lambda X: (weights * X).sum() + 0.5 * (X**2).sum()
    cold = lambda targets: proxel.deform(V, T, pins=pins, targets=targets, **given)
    for of, at in ((info, moved), (first, targets)):
        Y, run = cold(at)
        found, expected = of.adjoint(weights + Y), run.adjoint(weights + Y)
        np.testing.assert_array_equal(found.pins, pins)
        for name in ("targets", "V", "young", "poisson"):
            a, b = np.asarray(getattr(found, name)), np.asarray(getattr(expected, name))
            assert np.abs(a - b).max() < 1e-6 * np.abs(b).max(), name
    d = np.random.default_rng(4).standard_normal(targets.shape)
    slope = difference(lambda t: loss(cold(moved + t * d)[0]))
    assert (info.adjoint(weights + X).targets * d).sum() == pytest.approx(slope, rel=1e-5)


def test_a_pose_in_the_plane_and_what_a_lattice_carries():
    V, F = patch(6, 0.0)
    edge = np.flatnonzero(np.abs(V).max(1) == 1)
    live = proxel.Deformer(V[:, :2], F, pins=edge, targets=V[edge, :2] * [1.2, 1.0], young=1e4, **TIGHT)
    X, info = live.solve()
    g = info.adjoint(X)
    assert g.V.shape == (len(V), 2) and g.targets.shape == (len(edge), 2)
    # Everything magnified by 1 + t: so is the pose.
    grown = (g.V * V[:, :2]).sum() + (g.targets * V[edge, :2] * [1.2, 1.0]).sum()
    assert grown == pytest.approx((X**2).sum(), rel=1e-7)
    V, F = sphere(2)
    ends = np.flatnonzero(np.abs(V[:, 0]) > 0.9)
    live = proxel.Deformer(V, F, pins=ends, targets=1.1 * V[ends], resolution=6)
    X, info = live.solve()
    with pytest.raises(proxel.InputError, match="a lattice carries; give its tetrahedra"):
        info.adjoint(X)


def test_maps_in_the_making_answer_too():
    V, F = patch(6)
    corners = np.array([0, 48])
    live = proxel.Unwrapper(V, F, pins=corners, targets=[[0.0, 0.0], [2.0, 2.2]], pack=False, **TIGHT)
    live.solve()
    places = np.array([[0.0, 0.1], [2.1, 2.2]])
    live.update_handles(corners, places)
    uv, info = live.solve()
    whole, run = proxel.unwrap(V, F, pins=corners, targets=places, pack=False, **TIGHT)
    slope = np.cos(np.arange(uv.size)).reshape(uv.shape)
    found, expected = info.adjoint(slope), run.adjoint(slope)
    for name in ("V", "targets"):
        a, b = getattr(found, name), getattr(expected, name)
        assert np.abs(a - b).max() < 1e-6 * np.abs(b).max(), name
    live = proxel.Unwrapper(V, F, **TIGHT)
    uv, info = live.solve()
    assert info.density > 0
    with pytest.raises(proxel.InputError, match="pack=False"):
        info.adjoint(uv)


def test_a_surface_that_was_cut():
    """Rows of uv are more than vertices; the area of the map is that of the surface, nearly."""
    V, F = sphere(2)
    solve = lambda V: proxel.unwrap(V, F, pack=False, **TIGHT)
    uv, info = solve(V)
    assert len(uv) > len(V)

    def area(uv):
        a, b, c = (uv[info.uv_faces[:, k]] for k in range(3))
        return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum()

    slope = np.zeros_like(uv)
    for k in range(3):
        b, c = uv[info.uv_faces[:, (k + 1) % 3]], uv[info.uv_faces[:, (k + 2) % 3]]
        np.add.at(slope, info.uv_faces[:, k], 0.5 * np.c_[b[:, 1] - c[:, 1], c[:, 0] - b[:, 0]])
    g = info.adjoint(slope)
    # Magnified by 1 + t the map is magnified, and its area by (1 + t)^2.
    assert (g.V * V).sum() == pytest.approx(2 * area(uv), rel=1e-7)


def test_what_has_no_gradient_is_told():
    V, T, pins, targets, weights = pulled()
    X, info = proxel.deform(V, T, pins=pins, targets=targets, max_iters=1, method="newton")
    with pytest.raises(proxel.InputError, match="max-iters"):
        info.adjoint(weights)
    X, info = proxel.deform(V, T, pins=pins, targets=targets)
    with pytest.raises(proxel.InputError, match="shape"):
        info.adjoint(weights[:, :2])
    with pytest.raises(proxel.InputError, match="2 rows for 45 vertices"):
        info.adjoint(weights[:2])
    with pytest.raises(proxel.InputError, match="process that has solved"):
        pickle.loads(pickle.dumps(info)).adjoint(weights)
    V, F = patch(4)
    uv, info = proxel.unwrap(V, F)
    with pytest.raises(proxel.InputError, match="pack=False"):
        info.adjoint(uv)
    uv, info = proxel.unwrap(V, F, pack=False)
    with pytest.raises(proxel.InputError, match="24 rows for 25"):
        info.adjoint(uv[1:])
    _, info = proxel.geodesic(V, F, [0])
    with pytest.raises(proxel.InputError, match="deform and unwrap only"):
        info.adjoint(np.zeros((1, 3)))


def test_torch_differentiates():
    torch = pytest.importorskip("torch", reason="torch is not installed")
    import proxel.torch

    V, T, pins, targets, weights = pulled()
    tensor = lambda a: torch.tensor(a, dtype=torch.float64, requires_grad=True)
    given = dict(V=tensor(V), targets=tensor(targets), young=tensor(3e4), poisson=tensor(0.3))
    forces = np.zeros_like(V)
    forces[12] = [100, -200, 300]

    def solve(V, targets, young, poisson):
        X, info = proxel.torch.deform(
            V, T, pins=pins, targets=targets, young=young, poisson=poisson, forces=forces, **TIGHT
        )
        assert info.status == "converged"
        return (torch.as_tensor(weights) * X).sum() + 0.5 * (X**2).sum()

    solve(**given).backward()
    rng = np.random.default_rng(5)
    for name, scale in (("V", 0.3), ("targets", 1.0), ("young", 3e3), ("poisson", 0.3)):
        d = torch.tensor(scale * rng.standard_normal(given[name].shape))
        at = lambda t: solve(**{**given, name: (given[name] + t * d).detach()}).item()
        assert (given[name].grad * d).sum().item() == pytest.approx(difference(at), rel=1e-5), name
    # Of single precision in, of single precision out; what is no tensor has no gradient.
    half = torch.tensor(V, dtype=torch.float32, requires_grad=True)
    X, _ = proxel.torch.deform(half, T, pins=pins, targets=targets)
    X.sum().backward()
    assert X.dtype == torch.float32 and half.grad.dtype == torch.float32
    with pytest.raises(proxel.InputError, match="no gradient in mu"):
        proxel.torch.deform(given["V"], T, pins=pins, mu=tensor(1.0), lambda_=1.0)


def test_torch_fits_a_surface_to_its_map():
    torch = pytest.importorskip("torch", reason="torch is not installed")
    import proxel.torch

    V, F = patch(6)
    surface = torch.tensor(V, requires_grad=True)
    span = lambda uv: ((uv[0] - uv[48]) ** 2).sum()
    uv, info = proxel.torch.unwrap(surface, F, **TIGHT)
    span(uv).backward()
    at = lambda t: span(proxel.torch.unwrap(torch.tensor(V + t * np.eye(49)[0][:, None]), F, **TIGHT)[0]).item()
    assert surface.grad[0].sum().item() == pytest.approx(difference(at), rel=1e-5)


def test_jax_differentiates_and_compiles():
    jax = pytest.importorskip("jax", reason="jax is not installed")
    import jax.numpy as jnp

    import proxel.jax

    doubles = jax.enable_x64 if hasattr(jax, "enable_x64") else jax.experimental.enable_x64
    with doubles(True):
        V, T, pins, targets, weights = pulled()
        given = (jnp.asarray(V), jnp.asarray(targets), jnp.asarray(0.3))

        def loss(V, targets, poisson):
            X = proxel.jax.deform(V, T, pins=pins, targets=targets, poisson=poisson, young=3e4, **TIGHT)
            return (weights * X).sum() + 0.5 * (X**2).sum()

        slopes = jax.jit(jax.grad(loss, argnums=(0, 1, 2)))(*given)
        rng = np.random.default_rng(5)
        for k, scale in enumerate((0.3, 1.0, 0.3)):
            d = scale * rng.standard_normal(given[k].shape)
            at = lambda t: float(loss(*(v + t * d if i == k else v for i, v in enumerate(given))))
            assert float((slopes[k] * d).sum()) == pytest.approx(difference(at), rel=1e-5), k
        V, F = patch(6)
        span = lambda V: ((lambda uv: ((uv[0] - uv[48]) ** 2).sum())(proxel.jax.unwrap(V, F, **TIGHT)))
        slope = jax.grad(span)(jnp.asarray(V))
        at = lambda t: float(span(jnp.asarray(V + t * np.eye(49)[0][:, None])))
        assert float(slope[0].sum()) == pytest.approx(difference(at), rel=1e-5)


def test_the_rest_shape_of_a_sheet_that_bends():
    V, F = patch(5)
    held = np.flatnonzero(np.abs(V[:, 0]) == 1)
    targets = V[held] * [1.2, 1, 1] + 0.2 * V[held][:, :1] * [0, 0, 1]  # pulled, so that it does not buckle
    along = np.random.default_rng(3).uniform(-0.1, 0.1, V.shape)

    def solve(t):
        return proxel.deform(
            V + t * along, F, pins=held, targets=targets, surface="shell", material="stvk", young=1e4, poisson=0.3,
            bending=300.0, tol=1e-11,
        )

    X, info = solve(0.0)
    g = info.adjoint(X)
    loss = lambda t: 0.5 * (solve(t)[0] ** 2).sum()
    assert (g.V * along).sum() == pytest.approx(difference(loss, 1e-2), rel=1e-5)
