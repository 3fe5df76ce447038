"""Many meshes, each in a process of its own: one is no mesh, the others are mapped nevertheless."""

import shutil
import tempfile
from pathlib import Path

import numpy as np
from meshes import grid, picture, triangles

import proxel

folder = Path(tempfile.mkdtemp())
for k in range(3):
    V, Q = grid(12, lambda x, y: 0.3 * np.sin((k + 1) * x) * np.cos((k + 1) * y))
    np.savez(folder / f"wave{k}.npz", V=V, F=triangles(Q))
np.savez(folder / "broken.npz", V=V, F=triangles(Q) + 1000)

records = proxel.batch.run(folder, "unwrap", folder / "maps", preview=True, time_limit=60.0)
for record in records:
    print(f"{record['id']}: {record['status']}: {record['reason']}")
assert records.counts == {"refused": 1, "converged": 3}
# Again: all has been done.
assert list(proxel.batch.run(folder, "unwrap", folder / "maps", preview=True, time_limit=60.0)) == list(records)
shutil.copy(folder / "maps" / "wave2.png", picture())
