"""A roof of quads whose panels are to be of glass: every face becomes planar, near to the design."""

import numpy as np
from meshes import grid, picture

import proxel

V, Q = grid(16, lambda x, y: 0.35 * np.cos(1.4 * x) * np.cos(1.1 * y) + 0.1 * x * y)
X, info = proxel.planarize(V, Q)
before, after = info.planarity_max["before"], info.planarity_max["after"]
print(f"{info.status}: faces off their planes by {before:.1e} of an edge before, {after:.1e} after")
print(f"moved by {np.linalg.norm(X - V, axis=1).max():.3f} at most, of a roof 2 wide")
assert after < 1e-9 < before
info.save_preview(picture())
