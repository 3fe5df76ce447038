"""Calls from several threads, with and without a global lock."""

from __future__ import annotations

import sys
import sysconfig
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from conftest import beam, patch

import proxel


@pytest.mark.skipif(not sysconfig.get_config_var("Py_GIL_DISABLED"), reason="this Python has a global lock")
def test_the_lock_stays_off():
    assert not sys._is_gil_enabled()


def test_runs_at_the_same_time_have_the_bits_of_runs_in_turn():
    V, F = patch(10)
    B, T = beam()
    held = np.flatnonzero((B[:, 0] == 0) | (B[:, 0] == 3))

    def mapped(k):
        return proxel.unwrap(V * [1, 1, 1 + 0.1 * k], F, threads=1)[0]

    def posed(k):
        heard = []
        X, info = proxel.deform(
            B,
            T,
            pins=held,
            targets=B[held] * [1, 1.1 + 0.1 * k, 1],
            threads=1,
            callback=lambda p: heard.append(p.energy),
        )
        assert info.status == "converged" and len(heard) >= info.iterations > 0
        return X

    def own(k):
        energy = lambda G: (((G - np.eye(3)) ** 2).sum((1, 2)), 2 * (G - np.eye(3)))
        return proxel.deform(B, T, pins=held, targets=B[held] * (1 + 0.1 * k), energy=energy, method="lbfgs")[0]

    work = [(f, k) for k in range(4) for f in (mapped, posed, own)]
    with ThreadPoolExecutor(len(work)) as pool:
        together = list(pool.map(lambda item: item[0](item[1]), work))
    for (f, k), found in zip(work, together):
        np.testing.assert_array_equal(found, f(k), err_msg=f"{f.__name__} {k}")


def test_an_object_that_solves_refuses_other_calls():
    V, T = beam()
    ends = np.flatnonzero((V[:, 0] == 0) | (V[:, 0] == 3))
    live = proxel.Deformer(V, T, pins=ends, targets=V[ends] * [1, 1.5, 1])
    inside, ready = threading.Event(), threading.Event()

    def wait(progress):
        inside.set()
        ready.wait(60)

    job = proxel.Job(live.solve, callback=wait)
    assert inside.wait(60)
    with pytest.raises(RuntimeError, match="borrowed"):
        live.update_handles(ends, V[ends])
    ready.set()
    _, info = job.result(60)
    assert info.status == "converged"
    live.update_handles(ends, V[ends])
