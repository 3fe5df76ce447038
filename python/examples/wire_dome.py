"""A net of wires: all edges get one length, angles a range, near to a dome."""

import numpy as np
from meshes import grid, picture

import proxel

V, Q = grid(14, lambda x, y: 0.7 * np.exp(-(x**2 + y**2)))
X, info = proxel.wire(V, Q, min_angle=45, max_angle=135)
lengths = np.linalg.norm(X[Q] - X[np.roll(Q, -1, axis=1)], axis=2)
print(f"{info.status} after {info.iterations} iterations: edges from {lengths.min():.9f} to {lengths.max():.9f}")
assert info.edge_error_max["after"] < 1e-8 and np.ptp(lengths) < 1e-6 * lengths.mean()
info.save_preview(picture())
