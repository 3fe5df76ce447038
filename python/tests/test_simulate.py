"""Motion: against the formula of a free fall."""

from __future__ import annotations

import numpy as np
import pytest

import proxel

SCENE = {
    "time": {"dt": 0.02, "frames": 4},
    "body": [
        {
            "name": "cube",
            "generate": {"bar": {"cells": [2, 2, 2], "size": [1, 1, 1]}},
            "translate": [0, 2, 0],
            "material": {"energy": "neo-hookean", "young": 1e5, "poisson": 0.4},
            "density": 1000,
        }
    ],
}


def test_a_free_fall_by_implicit_euler():
    frames = list(proxel.simulate(SCENE))
    assert [f.frame for f in frames] == [0, 1, 2, 3, 4] and frames[0].status == "start"
    start = frames[0].positions["cube"]
    for k, frame in enumerate(frames):
        # v_k = -k g t; x_k = x_0 + t sum v.
        fall = -9.81 * 0.02**2 * k * (k + 1) / 2
        np.testing.assert_allclose(frame.positions["cube"], start + [0, fall, 0], atol=1e-9)
        velocity = np.tile([0, -9.81 * 0.02 * k, 0], (len(start), 1))
        np.testing.assert_allclose(frame.velocities["cube"], velocity, atol=1e-7)
        assert frame.time == pytest.approx(0.02 * k)
    assert frames[-1].status == "converged" and frames[-1].done


def test_the_same_bits_on_one_thread_and_settings_beside_the_scene(tmp_path):
    floor = {**SCENE, "obstacle": [{"shape": {"half-space": {"point": [0, 1.5, 0], "normal": [0, 1, 0]}}}]}
    one = proxel.simulate(floor, threads=1, frames=6)
    two = proxel.simulate(floor, threads=2, frames=6)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.positions["cube"], b.positions["cube"])
    assert a.frame == 6 and a.contacts > 0 and a.max_penetration < 1e-6
    assert one.info.status == "converged" and one.info.command == "simulate" and one.info.iterations > 0
    one.info.save_preview(tmp_path / "frame.png")
    assert (tmp_path / "frame.png").exists()


def test_a_simulator_goes_on_after_a_cancelled_step():
    simulator = proxel.Simulator(SCENE)
    assert simulator.frame.frame == 0 and simulator.frames == 4
    simulator.step()
    before = simulator.frame.positions["cube"].copy()
    frame = simulator.step(callback=lambda progress: True)
    assert not frame.done and frame.status == "cancelled" and simulator.frame.frame == 1
    np.testing.assert_array_equal(frame.positions["cube"], before)
    assert simulator.info.status == "cancelled"
    assert simulator.step().frame == 2
    stopped = proxel.simulate(SCENE, time_limit=0.0)
    assert [f.frame for f in stopped] == [0] and stopped.info.status == "stopped"


def test_scenes_that_are_refused(tmp_path):
    bad = {**SCENE, "time": {"dt": -1.0}}
    with pytest.raises(proxel.InputError, match=r"time\.dt: it is -1"):
        proxel.simulate(bad)
    with pytest.raises(proxel.InputError, match="frams"):
        proxel.simulate(SCENE, frams=3)
    with pytest.raises(proxel.InputError, match="nothing.toml"):
        proxel.simulate(tmp_path / "nothing.toml")
    with pytest.raises(AttributeError, match="no `speed`"):
        next(proxel.simulate(SCENE)).speed
