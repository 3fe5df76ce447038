"""planarize_quad_mesh of libigl (PyPI libigl, numpy, scipy) beside `proxel planarize`: a table in Markdown.

    python libigl_planarize.py PROXEL [MESH.obj [@REFERENCE.obj]] ... [--limit SECONDS] [--runs N] [--to PLANARITY]

Meshes of quads alone; without any, three sheets are made. A mesh is its own reference unless one follows. libigl gets as many iterations as it needs to the largest planarity (distance of a corner from the best plane over the mean
edge), found by doubling, or as many as the limit lets it have.
Seconds are of the processor, for proxel those of the whole command on one thread; the least of the runs.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import igl
import numpy as np


def read(path):
    points, faces = [], []
    for line in Path(path).read_text().splitlines():
        match line.split():
            case ["v", *rest]:
                points.append([float(c) for c in rest[:3]])
            case ["f", *rest]:
                faces.append([int(c.split("/")[0]) - 1 for c in rest])
    return np.array(points), faces


def write(path, points, faces):
    lines = ["v {!r} {!r} {!r}".format(*map(float, p)) for p in points]
    lines += ["f " + " ".join(str(v + 1) for v in face) for face in faces]
    Path(path).write_text("\n".join(lines) + "\n")


def sheet(n, height):
    """n x n quads over the unit square, on crossed waves."""
    at = np.linspace(0, 1, n + 1)
    x, y = np.meshgrid(at, at, indexing="ij")
    z = height * np.sin(5 * x + y) * np.cos(4 * y)
    corner = lambda i, j: i * (n + 1) + j
    faces = [[corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)] for i in range(n) for j in range(n)]
    return np.stack([x.ravel(), y.ravel(), z.ravel()], 1), faces


def triangles(faces):
    return np.array([[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)], dtype=np.int64)


class Figures:
    """Planarity, distance from the reference and shortest edge over the mean edge of the input."""

    def __init__(self, points, faces, reference):
        pairs = np.array([(f[k - 1], f[k]) for f in faces for k in range(len(f))])
        self.edges = np.unique(np.sort(pairs, 1), axis=0)
        self.mean = self.lengths(points).mean()
        self.faces, self.reference = np.array(faces), reference

    def lengths(self, points):
        return np.linalg.norm(points[self.edges[:, 0]] - points[self.edges[:, 1]], axis=1)

    def planarity(self, points):
        q = points[self.faces]
        q = q - q.mean(1, keepdims=True)
        return float(np.abs(q @ np.linalg.svd(q)[2][:, 2, :, None]).max() / self.mean)

    def __call__(self, points):
        square = igl.point_mesh_squared_distance(points, *self.reference)[0]
        distance = float(np.sqrt(square).mean() / self.mean)
        return self.planarity(points), distance, float(self.lengths(points).min() / self.mean)


def libigl(points, faces, count):
    """The result, iterations and seconds."""
    began = time.process_time()
    result = igl.planarize_quad_mesh(points, np.array(faces, dtype=np.int64), count, 1e-12)
    return result, count, time.process_time() - began


def enough(points, faces, figures, arguments):
    """Iterations, 125 doubled as often as needed, to the planarity; or the last whose double would take too long."""
    count = 125
    while True:
        result, _, took = libigl(points, faces, count)
        if figures.planarity(result) <= arguments.to or 2 * took > arguments.limit:
            return count
        count *= 2


def proxel(mesh, reference, arguments):
    with tempfile.TemporaryDirectory() as folder:
        out, report = Path(folder) / "out.obj", Path(folder) / "report.json"
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [arguments.proxel, "planarize", mesh, "--reference", reference, "--out", out, "--report", report]
        subprocess.run([*map(str, command), "--threads", "1", "--quiet"], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        took = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return read(out)[0], json.loads(report.read_text())["iterations"], took


def row(name, figures, points, iterations, seconds):
    planarity, distance, shortest = figures(points)
    print(f"| {name} | {planarity:.1e} | {distance:.3f} | {shortest:.3f} | {iterations} | {seconds} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("proxel")
    parser.add_argument("meshes", nargs="*", help="MESH.obj, then @REFERENCE.obj if it is not its own")
    parser.add_argument("--limit", type=float, default=300.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--to", type=float, default=1e-6)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        jobs = []
        for name in arguments.meshes:
            if name.startswith("@"):
                jobs[-1][1] = name[1:]
            else:
                jobs.append([name, name])
        if not jobs:
            for n, height in [(6, 0.05), (12, 0.05), (24, 0.1)]:
                path = str(Path(folder) / f"sheet of {n * n} quads.obj")
                write(path, *sheet(n, height))
                jobs.append([path, path])
        print("| | largest planarity | mean distance | shortest edge | iterations | seconds |\n|---|---|---|---|---|---|")
        for mesh, reference in jobs:
            points, faces = read(mesh)
            surface = read(reference)
            figures = Figures(points, faces, (surface[0], triangles(surface[1])))
            row(Path(mesh).stem, figures, points, "", "")
            count = enough(points, faces, figures, arguments)
            for name, run in [
                (f"libigl {version('libigl')}", lambda: libigl(points, faces, count)),
                ("proxel", lambda: proxel(mesh, reference, arguments)),
            ]:
                runs = [run() for _ in range(arguments.runs)]
                result, iterations, _ = runs[0]
                seconds = ", ".join(f"{r[2]:.2f}" for r in sorted(runs, key=lambda r: r[2]))
                row(name, figures, result, iterations, seconds)


if __name__ == "__main__":
    main()
