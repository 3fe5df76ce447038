"""A map in the making: vertices are held at places of your own, and the map goes on from where it was."""

import numpy as np
from meshes import grid, picture, triangles

import proxel

V, Q = grid(30, lambda x, y: 0.4 * np.exp(-4 * (x**2 + y**2)))
F = triangles(Q)
corners = [0, 30, 31 * 30, 31 * 31 - 1]

work = proxel.Unwrapper(V, F, pack=False)
uv, info = work.solve()
free = info.energy
work.update_handles(corners, [[-1, -1], [1, -1], [-1, 1], [1.4, 1.4]])
uv, info = work.solve()
print(f"energy {free:.4f} free, {info.energy:.4f} with a corner drawn out: {info.status}")
assert info.flips == 0 and info.energy > free
assert np.allclose(uv[corners], [[-1, -1], [1, -1], [-1, 1], [1.4, 1.4]])
info.save_preview(picture())
