"""`proxel deblur` beside ADMM of SCICO and ProxImaL (PyPI scico, jax, proximal, numpy) to the same objective: a table in Markdown.

    python deblur_scico_proximal.py PROXEL SEEN.npy PSF.txt [--lambda L] [--rho R] [--limit SECONDS] [--runs N] [--only NAME]

The problem is lambda |K x - f|^2 + sum |grad x| with a periodic border. proxel ends at a duality gap of 1e-4, and the
others when their objective is at most that of proxel's result. SCICO has the same objective (in single precision; its
iterates are measured in double). ProxImaL's differences end at the border, so that its objective has fewer terms and a lower least
value: what is asked of it is less. Both get the penalty R. Seconds are of the processor, all on one core: for proxel those of the
whole command, for the others of the iterations alone, without compilation and without the objective; of proxel and SCICO the
least of the runs.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np


def wraps(f, k):
    """The transform of the kernel around its middle pixel."""
    h = np.zeros(f.shape)
    for (a, b), v in np.ndenumerate(k):
        h[(a - k.shape[0] // 2) % f.shape[0], (b - k.shape[1] // 2) % f.shape[1]] += v
    return np.fft.rfft2(h)


def objective(x, f, spectrum, weight):
    x = np.asarray(x, dtype=float)
    r = np.fft.irfft2(spectrum * np.fft.rfft2(x), s=f.shape) - f
    return weight * (r * r).sum() + np.hypot(np.roll(x, -1, 1) - x, np.roll(x, -1, 0) - x).sum()


def proxel(args, f, spectrum):
    best = None
    with tempfile.TemporaryDirectory() as folder:
        out, report = Path(folder) / "x.npy", Path(folder) / "r.json"
        for _ in range(args.runs):
            command = [args.proxel, "deblur", args.seen, "--psf", args.psf, "--boundary", "periodic", "--tol", "1e-4"]
            command += ["--lambda", str(args.weight), "--threads", "1", "--quiet", "--out", out, "--report", report]
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(command, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            r = json.loads(report.read_text())
            if best is None or seconds < best[1]:
                best = (r["iterations"], seconds, objective(np.load(out), f, spectrum, args.weight))
    return best


def scico(args, f, k, spectrum, target):
    import jax
    import scico.numpy as snp
    from scico import functional, linop, loss
    from scico.optimize.admm import ADMM, CircularConvolveSolver

    y = snp.array(f.astype(np.float32))
    middle = snp.array([n // 2 for n in k.shape])
    A = linop.CircularConvolve(h=snp.array(k.astype(np.float32)), input_shape=f.shape, h_center=middle)
    D = linop.FiniteDifference(input_shape=f.shape, circular=True)

    def solver():
        return ADMM(
            f=loss.SquaredL2Loss(y=y, A=A, scale=args.weight),
            g_list=[functional.L21Norm()],
            C_list=[D],
            rho_list=[args.rho],
            x0=snp.zeros(f.shape, dtype=np.float32),
            maxiter=1,
            subproblem_solver=CircularConvolveSolver(),
        )

    first = solver()
    first.step()
    jax.block_until_ready(first.x)
    best = None
    for _ in range(args.runs):
        s, seconds, iterations, value = solver(), 0.0, 0, np.inf
        while value > target and seconds < args.limit:
            began = time.process_time()
            for _ in range(5):
                s.step()
            jax.block_until_ready(s.x)
            seconds, iterations = seconds + time.process_time() - began, iterations + 5
            value = objective(s.x, f, spectrum, args.weight)
        if best is None or seconds < best[1]:
            best = (iterations, seconds, value)
    return best


class Done(Exception):
    """Raised out of ProxImaL's loop."""


class Log:
    """What ProxImaL tells of its iterations."""

    def __init__(self, target, limit):
        self.target, self.limit = target, limit
        self.iterations, self.seconds, self.value, self.began = -1, 0.0, np.inf, 0.0

    def tic(self):
        self.began = time.process_time()

    def toc(self):
        self.seconds += time.process_time() - self.began

    def record_timing(self, _):
        pass

    def record_objective(self, value):
        self.iterations, self.value = self.iterations + 1, float(value)
        if self.iterations % 25 == 0:
            print(f"ProxImaL, {self.iterations}: {self.value:.3f}, {self.seconds:.1f} s", flush=True)
        if self.value <= self.target or self.seconds > self.limit:
            raise Done


def proximal(args, f, k, target):
    # Names that numpy and scipy had when ProxImaL was written.
    import scipy.misc

    for name in ("ascent", "lena"):
        if not hasattr(scipy.misc, name):
            setattr(scipy.misc, name, None)
    names = {"float": float, "int": int, "bool": bool, "complex": complex, "product": np.prod, "mat": np.asmatrix}
    names |= {"float_": np.float64, "complex_": np.complex128}
    for name, value in names.items():
        if name not in np.__dict__:
            setattr(np, name, value)
    import proximal as px

    x, log = px.Variable(f.shape), Log(target, args.limit)
    problem = px.Problem(args.weight * px.sum_squares(px.conv(k, x) - f) + px.group_norm1(px.grad(x), [2]))
    try:
        problem.solve(solver="admm", max_iters=10**6, eps_abs=1e-12, eps_rel=1e-12, rho=args.rho, convlog=log)
    except Done:
        pass
    return log.iterations, log.seconds, log.value


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("proxel")
    parser.add_argument("seen")
    parser.add_argument("psf")
    parser.add_argument("--lambda", dest="weight", type=float, default=400.0)
    parser.add_argument("--rho", type=float, default=20.0)
    parser.add_argument("--limit", type=float, default=600.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--only", choices=["scico", "proximal"])
    args = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    f, k = np.load(args.seen), np.loadtxt(args.psf)
    k /= k.sum()
    spectrum = wraps(f, k)
    ours = proxel(args, f, spectrum)
    rows = [("proxel", ours)]
    if args.only != "proximal":
        rows.append((f"SCICO {version('scico')}, jax {version('jax')}", scico(args, f, k, spectrum, ours[2])))
    if args.only != "scico":
        rows.append((f"ProxImaL {version('proximal')}", proximal(args, f, k, ours[2])))
    print(f"To the objective {ours[2]:.3f}:\n\n| | iterations | s | objective | over proxel's time |\n|---|---|---|---|---|")
    for name, (iterations, seconds, value) in rows:
        far = "" if value <= ours[2] else ", not reached"
        print(f"| {name} | {iterations} | {seconds:.2f} | {value:.3f}{far} | {seconds / ours[1]:.1f} |")


if __name__ == "__main__":
    main()
