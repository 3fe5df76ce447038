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


def held_beam():
    V, T = beam()
    ends = np.flatnonzero((V[:, 0] == 0) | (V[:, 0] == 3))
    return proxel.Deformer(V, T, pins=ends, targets=V[ends] * [1, 1.5, 1]), V, ends


def moving(frames=4):
    cube = {"name": "cube", "generate": {"bar": {"cells": [2, 2, 2], "size": [1, 1, 1]}}, "density": 1000}
    cube["material"] = {"energy": "neo-hookean", "young": 1e5, "poisson": 0.4}
    return proxel.Simulator({"time": {"dt": 0.02, "frames": frames}, "body": [cube]})


def test_an_object_that_solves_refuses_other_calls():
    live, V, ends = held_beam()
    inside, ready = threading.Event(), threading.Event()

    def wait(progress):
        inside.set()
        ready.wait(60)

    job = proxel.Job(live.solve, callback=wait)
    assert inside.wait(60)
    for call in (lambda: live.update_handles(ends, V[ends]), lambda: live.positions, live.solve):
        with pytest.raises(proxel.BusyError, match="this Deformer is at work .* wait until that call has returned"):
            call()
    assert issubclass(proxel.BusyError, RuntimeError) and not issubclass(proxel.BusyError, proxel.SolveError)
    ready.set()
    X, info = job.result(60)
    assert info.status == "converged"
    # What was refused has changed nothing.
    np.testing.assert_array_equal(X, held_beam()[0].solve()[0])
    live.update_handles(ends, V[ends])
    assert live.solve()[1].status == "converged"


@pytest.mark.parametrize("name", ["Deformer", "Unwrapper", "Simulator"])
def test_a_callback_cannot_call_its_own_object(name):
    if name == "Deformer":
        live, V, ends = held_beam()
        run, calls = live.solve, (live.solve, lambda: live.positions, lambda: live.move_group("pins", angle=3.0))
    elif name == "Unwrapper":
        live = proxel.Unwrapper(*patch(10))
        run, calls = live.solve, (live.step, live.map, lambda: live.update_handles([0], [[0.0, 0.0]]))
    else:
        live = moving()
        run, calls = live.step, (live.step, lambda: live.info, lambda: live.frames)
    words = f"this {name} is at work"
    heard = []

    def caught(progress):
        for call in calls:
            with pytest.raises(proxel.BusyError, match=words):
                call()
        heard.append(progress.iteration)

    # Caught, the run goes on to its end ..
    run(callback=caught)
    assert heard
    # .. and where it is not, it ends the run and is what the caller is told; the object can go on.
    if name == "Deformer":
        live.update_handles(ends, V[ends] * [1, 1.2, 1])
    elif name == "Unwrapper":
        live.update_handles([0, 5], [[0.0, 0.0], [0.3, 0.1]])
    with pytest.raises(proxel.BusyError, match=words):
        run(callback=lambda progress: calls[0]())
    run()


def test_frames_of_one_simulator_from_many_threads_are_each_done_once():
    live, busy = moving(24), []

    def step(_):
        try:
            return live.step().frame
        except proxel.BusyError as e:
            busy.append(e)
            return None

    with ThreadPoolExecutor(4) as pool:
        done = sorted(f for f in pool.map(step, range(24)) if f is not None)
    assert done == list(range(1, len(done) + 1)) and len(done) + len(busy) == 24
    assert live.step().frame == len(done) + 1
