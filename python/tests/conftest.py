"""Meshes without files."""

from __future__ import annotations

import itertools

import numpy as np
import pytest


def patch(n: int = 20, height: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """A heightfield over [-1, 1]^2: (n + 1)^2 vertices, 2 n^2 triangles."""
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    V = np.c_[x.ravel(), y.ravel(), (height * np.sin(2.5 * x) * np.cos(2 * y)).ravel()]
    return V, triangles(n)


def first_corners(n: int) -> np.ndarray:
    return np.arange(n * (n + 1)).reshape(n, n + 1)[:, :n].ravel()


def triangles(n: int) -> np.ndarray:
    i = first_corners(n)
    return np.r_[np.c_[i, i + 1, i + n + 2], np.c_[i, i + n + 2, i + n + 1]]


def quads(n: int) -> np.ndarray:
    i = first_corners(n)
    return np.c_[i, i + 1, i + n + 2, i + n + 1]


def sphere(levels: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """An octahedron, subdivided: closed."""
    V = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    F = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(levels):
        middles: dict[tuple[int, int], int] = {}

        def middle(a: int, b: int) -> int:
            key = (min(a, b), max(a, b))
            if key not in middles:
                m = np.add(V[a], V[b])
                V.append(tuple(m / np.linalg.norm(m)))
                middles[key] = len(V) - 1
            return middles[key]

        new = []
        for a, b, c in F:
            d, e, f = middle(a, b), middle(b, c), middle(c, a)
            new += [(a, d, f), (d, b, e), (f, e, c), (d, e, f)]
        F = new
    return np.array(V, dtype=float), np.array(F)


def beam(cells: tuple[int, int, int] = (6, 2, 2), size: tuple[float, float, float] = (3.0, 1.0, 1.0)):
    """A bar of six tetrahedra a cell (Kuhn), all of positive volume."""
    nx, ny, nz = cells
    grid = np.indices((nx + 1, ny + 1, nz + 1)).reshape(3, -1).T
    V = grid * (np.array(size) / cells)
    number = lambda p: (p[..., 0] * (ny + 1) + p[..., 1]) * (nz + 1) + p[..., 2]
    cell = np.indices(cells).reshape(3, -1).T
    T = []
    for order in itertools.permutations(range(3)):
        corners = [cell]
        for axis in order:
            corners.append(corners[-1] + np.eye(3, dtype=int)[axis])
        tet = np.stack([number(c) for c in corners], axis=1)
        # An odd permutation is turned inside out.
        odd = np.linalg.det(np.eye(3)[list(order)]) < 0
        T.append(tet[:, [0, 2, 1, 3]] if odd else tet)
    return V, np.concatenate(T)


def pytest_addoption(parser):
    parser.addoption("--full", action="store_true", help="the tests that take long too")


def pytest_configure(config):
    config.addinivalue_line("markers", "full: takes long; run with --full")


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--full"):
        for item in items:
            if item.get_closest_marker("full"):
                item.add_marker(pytest.mark.skip(reason="takes long; run with --full"))


@pytest.fixture
def surface():
    return patch()


@pytest.fixture
def body():
    return beam()
