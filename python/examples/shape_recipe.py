"""A recipe of constraints: a canopy of planar panels whose rim stays where it is while its middle is lifted."""

import numpy as np
from meshes import grid, picture

import proxel

V, Q = grid(12, lambda x, y: 0.25 * np.cos(np.pi * x / 2) * np.cos(np.pi * y / 2))
rim = np.flatnonzero(np.abs(V[:, :2]).max(1) == 1)
corners = [0, 12, 13 * 12, 13 * 13 - 1]
recipe = {
    "constraint": [
        {"kind": "planar"},
        {"kind": "fixed", "vertices": corners},
        {"kind": "near", "weight": 1.0},
    ]
}
X, info = proxel.shape(V, Q, recipe)
for constraint in info.constraints:
    print(constraint)
print(f"{info.status} after {info.iterations} iterations")
assert info.status == "converged" and np.abs(X[corners] - V[corners]).max() < 1e-9
info.save_preview(picture())
