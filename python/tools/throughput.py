"""Figures for docs/scale.md: a batch of maps by 1, 2, .. workers, beside the same calls in one process.

python tools/throughput.py [ITEMS [WORKERS ...]]
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))
from meshes import torus  # noqa: E402

import proxel  # noqa: E402


def used(who: int) -> float:
    """Processor seconds, of this process or of its children that have ended."""
    r = resource.getrusage(who)
    return r.ru_utime + r.ru_stime


def mesh(k: int) -> tuple[np.ndarray, np.ndarray]:
    """A torus with waves of its own: 4,800 vertices, 9,600 triangles, closed, so that it is cut."""
    V, F = torus(120, 40)
    return V * [1, 1, 1.4] + 0.05 * np.sin(4 * V[:, [1, 2, 0]] + 0.1 * k), F


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    numbers = [int(a) for a in sys.argv[2:]] or [1, 2]
    print(f"{count} meshes, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} before")
    print("workers | wall s | meshes/s | processor s a mesh | of it solving | largest memory MB")
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "in")
        source.mkdir()
        for k in range(count):
            V, F = mesh(k)
            np.savez(source / f"m{k:04}.npz", V=V, F=F)
        begun, before = time.monotonic(), used(resource.RUSAGE_SELF)
        for k in range(count):
            with np.load(source / f"m{k:04}.npz") as arrays:
                proxel.unwrap(arrays["V"], arrays["F"], threads=1)
        wall, processor = time.monotonic() - begun, used(resource.RUSAGE_SELF) - before
        print(f"one process, no batch | {wall:.1f} | {count / wall:.2f} | {processor / count:.3f} | |")
        for workers in numbers:
            out = Path(folder, f"out{workers}")
            begun, before = time.monotonic(), used(resource.RUSAGE_CHILDREN) + used(resource.RUSAGE_SELF)
            records = proxel.batch.run(source, "unwrap", out, workers=workers)
            wall = time.monotonic() - begun
            processor = used(resource.RUSAGE_CHILDREN) + used(resource.RUSAGE_SELF) - before
            assert records.counts == {"converged": count}, records.counts
            solving = sum(r["report"]["seconds"]["setup"] + r["report"]["seconds"]["solve"] for r in records)
            peak = max(r["peak_bytes"] or 0 for r in records) / 1e6
            each = f"{processor / count:.3f} | {solving / count:.3f}"
            print(f"{workers} | {wall:.1f} | {count / wall:.2f} | {each} | {peak:.0f}")
    print(f"load {os.getloadavg()[0]:.1f} after")


if __name__ == "__main__":
    main()
