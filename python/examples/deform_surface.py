"""A closed surface is bent as the body that it bounds: no tetrahedra are needed, a lattice carries it."""

import numpy as np
from meshes import picture, rotated, torus

import proxel

V, F = torus(40, 16)
held = np.flatnonzero(V[:, 0] < -1.1)
moved = np.flatnonzero(V[:, 0] > 1.1)
targets = np.r_[V[held], rotated(V[moved], (0, 1, 0), -60, (0, 0, 0)) + [0.2, 0, 0]]

X, info = proxel.deform(V, F, pins=np.r_[held, moved], targets=targets, young=1e6, resolution=10)
print(f"{info.status} after {info.iterations} iterations, energy {info.energy:.3e}, {info.inverted} inverted")
assert info.status == "converged" and info.inverted == 0
info.save_preview(picture())
