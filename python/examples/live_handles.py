"""A body is built once and follows its handle: matrices are kept, each pose goes on from the last."""

import numpy as np
from meshes import bar, picture, rotated

import proxel

V, T = bar((12, 3, 3), (3.0, 0.8, 0.8))
left, right = np.flatnonzero(V[:, 0] == 0), np.flatnonzero(V[:, 0] == 3)
deformer = proxel.Deformer(V, T, pins=np.r_[left, right], targets=np.r_[V[left], V[right]], young=1e6)
for degrees in range(15, 121, 15):
    targets = rotated(V[right], (0, 1, 0), -degrees, (1.2, 0.4, 0.4))
    deformer.update_handles(right, targets)
    X, info = deformer.solve(time_limit=10.0)
    print(f"{degrees:3} degrees: {info.status} after {info.iterations} iterations, {info.energy:.3e} J")
    assert info.status == "converged" and info.inverted == 0
# Pictures are of single runs: one that begins at the pose and stays there.
_, shown = proxel.deform(
    V, T, pins=np.r_[left, right], targets=np.r_[V[left], targets], start=X, young=1e6, max_iters=0
)
shown.save_preview(picture())
