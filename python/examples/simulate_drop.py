"""A soft bar falls across a ball that nothing enters; each frame says whether its step converged."""

from meshes import picture

import proxel

scene = {
    "time": {"dt": 0.02, "frames": 20},
    "body": [
        {
            "name": "bar",
            "generate": {"bar": {"cells": [12, 2, 3], "size": [2.0, 0.25, 0.4]}},
            "material": {"energy": "neo-hookean", "young": 2e4, "poisson": 0.4, "density": 1000.0},
            "translate": [0.2, 1.0, 0.0],
        }
    ],
    "obstacle": [
        {"shape": {"half-space": {"point": [0, 0, 0], "normal": [0, 1, 0]}}},
        {"shape": {"sphere": {"center": [0, 0.2, 0], "radius": 0.4}}},
    ],
}
frames = proxel.simulate(scene)
for frame in frames:
    print(f"{frame.time:.2f} s: {frame.status}, {frame.contacts} contacts, penetration {frame.max_penetration:.1e}")
assert frame.status == "converged" and frame.max_penetration < 1e-6
frames.info.save_preview(picture())
