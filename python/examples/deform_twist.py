"""A rubber bar whose ends are turned against each other by a third of a turn, and pulled."""

import numpy as np
from meshes import bar, picture, rotated

import proxel

V, T = bar((24, 6, 6), (4.0, 1.0, 1.0))
left, right = np.flatnonzero(V[:, 0] == 0), np.flatnonzero(V[:, 0] == 4)
turned = rotated(V[right], (1, 0, 0), 120, (4, 0.5, 0.5)) + [0.5, 0, 0]

X, info = proxel.deform(
    V, T, pins=np.r_[left, right], targets=np.r_[V[left], turned], material="neo-hookean", young=1e6, poisson=0.45
)
torque = np.cross(X[right] - [4.5, 0.5, 0.5], info.reaction[right])[:, 0].sum()
print(f"{info.status} after {info.iterations} iterations: {info.energy:.4e} J, {abs(torque):.3e} N m hold it")
assert info.status == "converged" and info.inverted == 0
info.save_preview(picture())
