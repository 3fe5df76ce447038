"""What a call from Python costs over the command: time of setting up and solving, and the largest memory.

    PROXEL_DATA=FOLDER python tools/against_cli.py PROGRAM [REPEATS]

dino is unwrapped and centaur deformed, by turns by the command and by a new process of Python that has the same arrays in
a file. Of both the least of several is taken: seconds from the report (`setup` and `solve`), and those of the whole call
and of the whole command, which reads and writes files; the largest resident memory of the process, and for Python how much
of that was there before the call. Also what it takes to import the package, the least of several new processes.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

DATA = Path(os.environ.get("PROXEL_DATA", "."))
CENTAUR = DATA / "quasistatic" / "centaur"
DINO = DATA / "parameterization" / "dino.obj"


def largest() -> int:
    """The largest resident memory so far in bytes."""
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmHWM:"))


def child(job: str, path: str) -> None:
    """A call in a process of its own: prints what it took as JSON."""
    import proxel

    with np.load(path) as arrays:
        given = {name: arrays[name] for name in arrays.files}
    before, begun = largest(), time.perf_counter()
    if job == "unwrap":
        out, info = proxel.unwrap(given["V"], given["F"], threads=2)
    else:
        out, info = proxel.deform(**given, threads=2)
    whole = time.perf_counter() - begun
    held = sum(a.nbytes for a in given.values()) + out.nbytes
    took = info.seconds["setup"] + info.seconds["solve"]
    found = {"took": took, "whole": whole, "peak": largest(), "before": before, "arrays": held, "status": info.status}
    print(json.dumps(found))


def command(program: str, words: list[str], folder: Path) -> dict[str, Any]:
    """The same of the command."""
    report = folder / "report.json"
    begun = time.perf_counter()
    subprocess.run([program, *words, "--threads", "2", "--report", report], check=True, capture_output=True)
    whole = time.perf_counter() - begun
    told = json.loads(report.read_text())
    took = told["seconds"]["setup"] + told["seconds"]["solve"]
    return {"took": took, "whole": whole, "peak": told["peak_bytes"], "status": told["status"]}


def node(path: Path) -> np.ndarray:
    """The points of a TetGen file."""
    rows = [line.split("#")[0].split() for line in path.read_text().splitlines()]
    rows = [row for row in rows if row]
    return np.array([[float(v) for v in row[1:4]] for row in rows[1:]])


def tetrahedra(path: Path) -> np.ndarray:
    """The elements of a TetGen file, 0-based."""
    rows = [line.split("#")[0].split() for line in path.read_text().splitlines()]
    rows = [[int(v) for v in row[:5]] for row in rows if row][1:]
    return np.array(rows)[:, 1:] - rows[0][0]


def imported(repeats: int) -> tuple[float, float]:
    """Seconds that importing numpy and proxel take, and numpy alone."""
    least = [np.inf, np.inf]
    for _ in range(repeats):
        for k, what in enumerate(("numpy, proxel", "numpy")):
            code = f"import time; t = time.perf_counter(); import {what}; print(time.perf_counter() - t)"
            # Isolated: the folder that this is run in may hold the sources, which have no compiled part.
            run = subprocess.run([sys.executable, "-I", "-c", code], check=True, capture_output=True, text=True)
            least[k] = min(least[k], float(run.stdout))
    return least[0], least[1]


def main() -> None:
    program, repeats = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    from proxel import interop

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        V, F = interop.faces(DINO)
        np.savez(folder / "unwrap.npz", V=V, F=F)
        pins = np.array((CENTAUR / "handles.txt").read_text().split(), dtype=np.int64)
        rest, start = node(CENTAUR / "rest.node"), node(CENTAUR / "init.node")
        np.savez(folder / "deform.npz", V=rest, T=tetrahedra(CENTAUR / "rest.ele"), pins=pins, start=start)
        words = {
            "unwrap": ["unwrap", str(DINO), "--out", str(folder / "out.obj")],
            "deform": ["deform", str(CENTAUR / "rest.node"), "--pins", str(CENTAUR / "handles.txt")]
            + ["--init", str(CENTAUR / "init.node"), "--out", str(folder / "out.node")],
        }
        for job, given in words.items():
            ours: list[dict[str, Any]] = []
            theirs: list[dict[str, Any]] = []
            for _ in range(repeats):
                theirs.append(command(program, given, folder))
                call = [sys.executable, __file__, "--child", job, str(folder / f"{job}.npz")]
                ours.append(json.loads(subprocess.run(call, check=True, capture_output=True, text=True).stdout))
            assert {r["status"] for r in [*ours, *theirs]} == {"converged"}, (ours, theirs)
            least = lambda of, key: min(r[key] for r in of)
            ratio = lambda key: least(ours, key) / least(theirs, key)
            print(f"{job}: setup and solve {ratio('took'):.3f} of the command's, the whole call", end=" ")
            print(
                f"{ratio('whole'):.3f} of the whole command; peak {least(ours, 'peak') / 1e6:.1f} MB, of which", end=" "
            )
            print(f"{least(ours, 'before') / 1e6:.1f} were there before the call, the command", end=" ")
            print(f"{least(theirs, 'peak') / 1e6:.1f} MB, the arrays {ours[0]['arrays'] / 1e6:.1f} MB")
    both, numpy = imported(5)
    print(f"import: {both:.3f} s with numpy, numpy alone {numpy:.3f} s")


if __name__ == "__main__":
    if sys.argv[1] == "--child":
        child(*sys.argv[2:4])
    else:
        main()
