"""A closed surface becomes a map: it is cut along few seams, flattened, and certified."""

import numpy as np
from meshes import picture, torus

import proxel

V, F = torus()
V = V * [1.0, 1.0, 1.4] + 0.08 * np.sin(5 * V[:, [1, 2, 0]])

uv, info = proxel.unwrap(V, F)
print(f"{info.status} after {info.iterations} iterations: energy {info.energy:.4f} (1 is an isometry)")
print(f"{len(V)} vertices, {len(uv)} of the map, seams of length {info.seam_length:.2f} over the diagonal")
assert info.status == "converged" and info.flips == 0 and info.overlaps == 0
info.save_preview(picture())
