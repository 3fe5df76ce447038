"""A run in the background with its history: the program goes on, hears of it, and could end it."""

import numpy as np
from meshes import bar, picture, rotated

import proxel

V, T = bar((14, 3, 3), (4.0, 1.0, 1.0))
left, right = np.flatnonzero(V[:, 0] == 0), np.flatnonzero(V[:, 0] == 4)
targets = np.r_[V[left], rotated(V[right], (0, 0, 1), 90, (2, 1.5, 0.5))]
job = proxel.Job(proxel.deform, V, T, pins=np.r_[left, right], targets=targets, young=1e6, trace=True)
while not job.wait(0.2):
    print("still at it:", job.progress)
X, info = job.result()
for k in range(0, len(info.trace), 5):
    print(f"{info.trace.iteration[k]:4} energy {info.trace.energy[k]:.6e} gradient {info.trace.gradient_norm[k]:.2e}")
assert info.status == "converged" and info.trace.gradient_norm[-1] < info.trace.gradient_norm[0]
info.save_preview(picture())
