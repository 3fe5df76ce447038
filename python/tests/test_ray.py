"""Batches on a real Ray cluster of two nodes on this machine, one of which is killed in the middle."""

from __future__ import annotations

import json
import os
import signal
import threading
from collections import Counter

import numpy as np
import pytest
from conftest import patch

import proxel
from proxel import batch

pytestmark = pytest.mark.full

COUNT = 24


@pytest.fixture
def cluster():
    ray = pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    # What is not needed takes long to start.
    os.environ["RAY_DISABLE_MEMORY_MONITOR"] = "1"
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        ray.init(address=cluster.address, log_to_driver=False)
        yield cluster
    finally:
        ray.shutdown()
        cluster.shutdown()


def test_a_node_that_is_lost_and_an_item_that_aborts_cost_no_other_item(cluster, tmp_path):
    from batch_jobs import work

    log = tmp_path / "log"
    (victim,) = cluster.worker_nodes
    raylet = str(victim.all_processes["raylet"][0].process.pid)
    common = {"log": str(log), "sleep": 0.2, "victim": raylet}
    todo = [{"id": f"i{k}", "act": "abort" if k == 5 else "fine", **common} for k in range(COUNT)]
    killed, over = threading.Event(), threading.Event()

    def kill():
        """The node, when some items have ended and it is in the middle of one."""
        while not over.wait(0.05):
            if log.exists() and "middle" in (text := log.read_text()):
                cluster.remove_node(victim, allow_graceful=False)
                print(f"the node that was in the middle of {text.split('middle ')[1].split()[0]} was killed")
                killed.set()
                return

    def progress(p):
        print(f"{p.done:2} of {p.total}: {p.record['id']} {p.record['status']}, lost {p.record['losses']} times")

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    try:
        records = batch.run(todo, work, tmp_path / "out", engine="ray", workers=4, progress=progress)
        assert killed.is_set()
    finally:
        over.set()
        killer.join()
    # Every other item has ended, and the one that aborts says how.
    assert [r["id"] for r in records] == [f"i{k}" for k in range(COUNT)]
    assert records.counts == {"done": COUNT - 1, "crashed": 1}
    assert (records["i5"]["status"], records["i5"]["signal"]) == ("crashed", signal.SIGABRT)
    for k in range(COUNT):
        if k != 5:
            with np.load(tmp_path / "out" / f"i{k}.npz") as arrays:
                assert arrays["square"].tolist() == [0, k, 4 * k]
    # None is lost, and none is there twice.
    lines = [json.loads(line) for line in (tmp_path / "out" / "results.jsonl").read_text().splitlines()]
    assert Counter(r["id"] for r in lines) == {f"i{k}": 1 for k in range(COUNT)}
    # What was begun again was lost on the node that was killed; no other item ran twice.
    text = [line.split()[:2] for line in log.read_text().splitlines()]
    count = lambda word: Counter(name for what, name in text if what == word)
    begun, ended, lost = count("begin"), count("end"), {r["id"]: r["losses"] for r in lines}
    assert sum(lost.values()) >= 1 and set(begun) == set(lost)
    assert all(1 <= begun[name] <= 1 + lost[name] for name in begun)
    assert all(lost[name] >= 1 for name in count("middle"))
    # An item may have ended on the lost node before its answer came home.
    assert all(1 <= ended[name] <= 1 + lost[name] for name in set(lost) - {"i5"}) and "i5" not in ended
    # Nothing is left to do.
    again = batch.run(todo, work, tmp_path / "out", engine="ray", progress=lambda p: pytest.fail("done twice"))
    assert list(again) == list(records)


def test_ray_has_the_bits_of_this_machine(cluster, tmp_path):
    source = []
    for k in range(4):
        V, F = patch(4 + k)
        source.append({"id": str(k), "V": V, "F": F})
    there = batch.run(source, "unwrap", tmp_path / "ray", engine="ray")
    here = batch.run(source, "unwrap", tmp_path / "local")
    assert there.counts == here.counts == {"converged": 4}
    for k, entry in enumerate(source):
        expected = proxel.unwrap(entry["V"], entry["F"])[0]
        for folder in ("ray", "local"):
            with np.load(tmp_path / folder / f"{k}.npz") as arrays:
                np.testing.assert_array_equal(arrays["uv"], expected)
