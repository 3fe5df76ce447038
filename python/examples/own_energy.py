"""An energy of your own, in numpy: fibres along x stiffen a body against being stretched that way."""

import numpy as np
from meshes import bar, picture

import proxel


def fibres(F, mu=2e4, k=4e4):
    """mu |F - R|^2 + k/2 (|F a|^2 - 1)^2 with a = e_x and R the nearest rotation; and its derivative (m, 3, 3)."""
    U, _, W = np.linalg.svd(F)
    U[np.linalg.det(U @ W) < 0, :, -1] *= -1
    D, f = F - U @ W, F[:, :, 0]
    s = (f**2).sum(1) - 1
    P = 2 * mu * D
    P[:, :, 0] += 2 * k * s[:, None] * f
    return mu * (D**2).sum((1, 2)) + k / 2 * s**2, P


V, T = bar((10, 2, 2), (3.0, 0.8, 0.8))
held = np.flatnonzero(V[:, 0] == 0)
pull = np.zeros_like(V)
pull[V[:, 0] == 3] = [60.0, 0.0, -25.0]
common = dict(pins=held, forces=pull, method="lbfgs", material="arap", mu=2e4, lambda_=0.0)
plain, _ = proxel.deform(V, T, **common)
X, info = proxel.deform(V, T, energy=fibres, **common)
print(
    f"{info.status} after {info.iterations} iterations: longest {X[:, 0].max():.3f}, "
    f"{plain[:, 0].max():.3f} without fibres"
)
assert info.status == "converged" and X[:, 0].max() < plain[:, 0].max()
# The picture is of the built-in material, in that pose.
_, shown = proxel.deform(V, T, start=X, max_iters=0, **{**common, "method": "auto"})
shown.save_preview(picture())
