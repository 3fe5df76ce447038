"""Distances along a surface from two of its vertices, as isolines."""

import numpy as np
from meshes import picture, torus

import proxel

V, F = torus(64, 26)
sources = [0, 26 * 24 + 6]
distance, info = proxel.geodesic(V, F, sources)
straight = np.linalg.norm(V[:, None] - V[sources], axis=2).min(1)
print(f"{info.status}: the farthest vertex is {distance.max():.3f} away, {straight.max():.3f} through the air")
# The heat method is exact in the limit of fine meshes; the sources, at 0, show how fine this one is.
assert np.abs(distance[sources]).max() < 0.01 * distance.max() and distance.max() > straight.max()
info.save_preview(picture())
