"""What an energy in numpy costs: processor time an iteration of ARAP, beside the built-in one.

python tools/own_energy.py [CELLS]

Both by L-BFGS over the same prefactored matrix, on one thread (OMP_NUM_THREADS=1 for numpy's), for the same number of
iterations. What a run of no iterations takes, set-up and report, is left out. The least of five.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))
from meshes import bar, rotated  # noqa: E402

import proxel  # noqa: E402

ITERATIONS = 20


def arap(F: np.ndarray, mu: float = 2e4) -> tuple[np.ndarray, np.ndarray]:
    """mu |F - R|^2 and its derivative, R the rotation nearest to F."""
    U, _, W = np.linalg.svd(F)
    U[np.linalg.det(U @ W) < 0, :, -1] *= -1
    d = F - U @ W
    return mu * (d**2).sum((1, 2)), 2 * mu * d


def main() -> None:
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    V, T = bar((4 * n, n, n), (4.0, 1.0, 1.0))
    left, right = np.flatnonzero(V[:, 0] == 0), np.flatnonzero(V[:, 0] == 4)
    targets = np.r_[V[left], rotated(V[right], (1, 0, 0), 150, (4, 0.5, 0.5)) + [0.5, 0, 0]]
    common = dict(pins=np.r_[left, right], targets=targets, material="arap", mu=2e4, lambda_=0.0)
    calls = 0

    def own(F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nonlocal calls
        calls += 1
        return arap(F)

    def used(iterations: int, **energy: object) -> float:
        began = time.process_time()
        _, info = proxel.deform(V, T, method="lbfgs", threads=1, max_iters=iterations, tol=1e-15, **common, **energy)
        if info.iterations != iterations:
            raise SystemExit(f"it ended after {info.iterations} iterations: {info.reason}")
        return time.process_time() - began

    least = []
    for energy in ({}, {"energy": own}):
        none, some = (min(used(k, **energy) for _ in range(5)) for k in (0, ITERATIONS))
        least.append(1e3 * (some - none) / ITERATIONS)
    print(f"{len(T)} tetrahedra; processor milliseconds an iteration: built in {least[0]:.2f}, numpy {least[1]:.2f}")
    print(f"{least[1] / least[0]:.1f} times; {calls / (5 * ITERATIONS):.2f} calls of the function an iteration")


if __name__ == "__main__":
    main()
