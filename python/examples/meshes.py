"""Meshes that the examples make instead of reading them, and where they leave their pictures."""

import itertools
import sys
from pathlib import Path

import numpy as np


def picture():
    """The file that the picture goes to: the argument of the script, or its name with .png."""
    return Path(sys.argv[1]) if len(sys.argv) > 1 else Path(Path(sys.argv[0]).stem + ".png")


def grid(n, height=lambda x, y: 0 * x):
    """A heightfield over [-1, 1]^2: positions ((n + 1)^2, 3) and quads (n^2, 4)."""
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    i = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :n].ravel()
    return np.c_[x.ravel(), y.ravel(), height(x, y).ravel()], np.c_[i, i + 1, i + n + 2, i + n + 1]


def triangles(quads):
    """Two for each quad."""
    return np.r_[quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]


def torus(n=48, m=20, radius=1.0, tube=0.4):
    """A closed surface with a hole: n m positions and 2 n m triangles."""
    u, v = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a, b = 2 * np.pi * u / n, 2 * np.pi * v / m
    r = radius + tube * np.cos(b)
    V = np.stack([r * np.cos(a), r * np.sin(a), tube * np.sin(b)], axis=-1).reshape(-1, 3)
    number = lambda i, j: ((i % n) * m + j % m).ravel()
    return V, triangles(np.c_[number(u, v), number(u + 1, v), number(u + 1, v + 1), number(u, v + 1)])


def bar(cells, size):
    """A bar of six tetrahedra a cell, from the origin: positions and tetrahedra of positive volume."""
    nx, ny, nz = cells
    V = np.indices((nx + 1, ny + 1, nz + 1)).reshape(3, -1).T * (np.array(size) / cells)
    cell = np.indices(cells).reshape(3, -1).T
    number = lambda p: (p[:, 0] * (ny + 1) + p[:, 1]) * (nz + 1) + p[:, 2]
    T = []
    for order in itertools.permutations(range(3)):
        path = [cell] + [cell + np.eye(3, dtype=int)[list(order[: k + 1])].sum(0) for k in range(3)]
        tets = np.stack([number(p) for p in path], axis=1)
        T.append(tets if np.linalg.det(np.eye(3)[list(order)]) > 0 else tets[:, [0, 2, 1, 3]])
    return V, np.concatenate(T)


def rotated(points, axis, degrees, center=(0.0, 0.0, 0.0)):
    """Points turned around an axis through a centre, by Rodrigues' formula."""
    k, c, t = np.array(axis) / np.linalg.norm(axis), np.array(center), np.radians(degrees)
    p = points - c
    return c + p * np.cos(t) + np.cross(k, p) * np.sin(t) + np.outer(p @ k, k) * (1 - np.cos(t))


def checks(n=96):
    """An image (n, n) with edges of all directions: squares, a disk and a ramp."""
    y, x = np.mgrid[:n, :n] / n
    image = np.where((np.floor(6 * x) + np.floor(6 * y)) % 2 > 0, 0.75, 0.25)
    image[(x - 0.5) ** 2 + (y - 0.5) ** 2 < 0.09] = 0.9
    return np.where(y > 0.8, x, image)
