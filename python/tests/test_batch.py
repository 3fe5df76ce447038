"""Batches: what one item does to the others, what is kept, what is done again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from batch_jobs import work
from conftest import beam, patch, quads

import proxel
from proxel import batch
from proxel.batch._journal import Journal

HERE = Path(__file__).parent
posix = pytest.mark.skipif(os.name == "nt", reason="signals and limits of POSIX")


def items(tmp_path, acts, **more):
    log = str(tmp_path / "log")
    return [{"id": f"i{k}", "act": act, "log": log, **more} for k, act in enumerate(acts)]


def logged(tmp_path, word):
    lines = (tmp_path / "log").read_text().splitlines()
    return Counter(line.split()[1] for line in lines if line.startswith(word))


def lines(out):
    return [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]


def meshes(folder, count=3):
    folder.mkdir()
    for k in range(count):
        V, F = patch(4 + k)
        np.savez(folder / f"m{k}.npz", V=V, F=F)
    return folder


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().split(")")[-1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_a_folder_has_the_bits_of_single_calls_and_is_not_done_twice(tmp_path):
    source, out = meshes(tmp_path / "in"), tmp_path / "in" / "out"
    (source / "sub").mkdir()
    V, F = patch(5)
    rows = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in V.tolist()) + "".join(
        f"f {a}//1 {b} {c}\n" for a, b, c in F + 1
    )
    (source / "sub" / "a b.obj").write_text("# made\n" + rows)
    records = batch.run(source, "unwrap", out, settings={"tol": 1e-8}, workers=2)
    assert [r["id"] for r in records] == ["m0.npz", "m1.npz", "m2.npz", "sub/a b.obj"]
    assert records.counts == {"converged": 4} and records["m1.npz"]["report"]["flips"] == 0
    for k, name in enumerate(("m0", "m1", "m2", "sub/a b")):
        V, F = patch((4, 5, 6, 5)[k])
        uv, info = proxel.unwrap(V, F, tol=1e-8)
        with np.load(out / f"{name}.npz") as arrays:
            np.testing.assert_array_equal(arrays["uv"], uv)
            np.testing.assert_array_equal(arrays["uv_faces"], F)
        assert records[k]["report"]["energy"] == info.energy and records[k]["out"] == f"{name}.npz"

    heard = []
    again = batch.run(source, "unwrap", out, settings={"tol": 1e-8}, progress=heard.append)
    assert heard == [] and list(again) == list(records) and len(lines(out)) == 4

    # What has changed is done again: a file, then a setting of all.
    np.savez(source / "m0.npz", V=patch(7)[0], F=patch(7)[1])
    batch.run(source, "unwrap", out, settings={"tol": 1e-8}, progress=heard.append)
    assert [p.record["id"] for p in heard] == ["m0.npz"] and heard[0].done == heard[0].total == 4
    batch.run(source, "unwrap", out, settings={"tol": 1e-7}, progress=heard.append)
    assert len(heard) == 5 and len(lines(out)) == 9 and len(batch.read_results(out)) == 4


@posix
def test_what_one_item_does_to_its_process_no_other_notices(tmp_path):
    acts = ["fine", "abort", "fine", "segv", "raise", "exit", "memory", "sleep", "nothing", "fine"]
    todo = items(tmp_path, acts)
    todo[7]["sleep"] = 60
    records = batch.run(todo, work, tmp_path / "out", workers=2, time_limit=2.0, memory_limit="1G")
    got = [(r["status"], r["signal"], r["exit_code"]) for r in records]
    fine, ABRT, SEGV, KILL = ("done", None, None), signal.SIGABRT, signal.SIGSEGV, signal.SIGKILL
    crashed = [("crashed", ABRT, None), ("crashed", SEGV, None), ("crashed", None, 3)]
    others = [("failed", None, None), ("memory", None, None), ("timeout", KILL, None)]
    assert got == [fine, crashed[0], fine, crashed[1], others[0], crashed[2], others[1], others[2], fine, fine]
    assert "SIGABRT" in records[1]["reason"] and "KeyError: 'mine'" in records[4]["reason"]
    assert records[5]["reason"].endswith("exit status 3: had enough") and "MemoryError" in records[6]["reason"]
    assert records[9]["report"] == {"name": "i9", "bad": None} and records[8]["out"] is None
    with np.load(tmp_path / "out" / "i9.npz") as arrays:
        assert arrays["square"].tolist() == [0, 9, 36]
    # One line an item; what is fine ran once.
    assert Counter(r["id"] for r in lines(tmp_path / "out")) == {f"i{k}": 1 for k in range(10)}
    begun = logged(tmp_path, "begin")
    assert all(begun[f"i{k}"] == 1 for k in (0, 2, 4, 7, 8, 9)) and logged(tmp_path, "end") == {
        "i0": 1,
        "i2": 1,
        "i9": 1,
    }
    # A second run does nothing; retry_failed does what has no result.
    batch.run(todo, work, tmp_path / "out")
    assert logged(tmp_path, "begin") == begun
    for entry in todo:
        entry["act"] = "fine" if entry["act"] == "abort" else entry["act"]
    again = batch.run(todo, work, tmp_path / "out", workers=2, time_limit=2.0, memory_limit="1G")
    assert again[1]["status"] == "done" and again[3]["status"] == "crashed"
    before = logged(tmp_path, "begin")
    todo[7]["sleep"] = 60.0
    batch.run(todo[:7], work, tmp_path / "out", memory_limit="1G", retry_failed=True)
    again = logged(tmp_path, "begin") - before
    assert set(again) == {"i3", "i4", "i5", "i6"}


@posix
def test_retries_are_for_what_kills_a_process(tmp_path):
    todo = items(tmp_path, ["abort once", "abort", "raise"], mark=str(tmp_path / "mark"))
    records = batch.run(todo, work, tmp_path / "out", workers=1, retries=2)
    assert [(r["status"], r["attempts"]) for r in records] == [("done", 2), ("crashed", 3), ("failed", 1)]
    assert logged(tmp_path, "begin") == {"i0": 2, "i1": 3, "i2": 1}


# Where the tests run in the background of a shell SIGINT is ignored, and processes inherit that.
SCRIPT = """
import signal, sys, batch_jobs
from proxel import batch
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    items = [{"id": f"i{k}", "log": sys.argv[2], "sleep": 0.25} for k in range(12)]
    batch.run(items, batch_jobs.work, sys.argv[1], workers=2, progress=lambda p: print(p.done, flush=True))
"""


@posix
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_batch_that_was_broken_off_goes_on(tmp_path, number):
    """By Ctrl-C, and by a kill that leaves it no time for anything."""
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "out"), str(tmp_path / "log")]
    pipe = subprocess.PIPE
    run = subprocess.Popen(command, cwd=HERE, stdout=pipe, stderr=pipe, text=True)
    for _ in range(3):
        run.stdout.readline()
    run.send_signal(number)
    _, errors = run.communicate(timeout=60)
    if number == signal.SIGINT:
        assert errors.strip().endswith("KeyboardInterrupt")
    # No process is left behind.
    workers = {line.split()[2] for line in (tmp_path / "log").read_text().splitlines()}
    for _ in range(100):
        if not any(map(alive, workers)):
            break
        time.sleep(0.05)
    assert not any(map(alive, workers))
    kept = lines(tmp_path / "out")
    assert 3 <= len(kept) < 12
    done = subprocess.run(command, cwd=HERE, check=True, capture_output=True, text=True).stdout.split()
    assert len(done) == 12 - len(kept)
    assert Counter(r["id"] for r in lines(tmp_path / "out")) == {f"i{k}": 1 for k in range(12)}
    assert lines(tmp_path / "out")[: len(kept)] == kept
    # What has a line is not done again; of the rest what was running at the end is, one item a worker.
    begun, ended = logged(tmp_path, "begin"), logged(tmp_path, "end")
    assert set(ended) == {f"i{k}" for k in range(12)}
    assert all(begun[r["id"]] == 1 for r in kept) and sum(begun.values()) <= 14


@posix
def test_what_progress_raises_ends_the_batch(tmp_path):
    def progress(p):
        if p.done == 2:
            raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        batch.run(items(tmp_path, ["fine"] * 5, sleep=0.1), work, tmp_path / "out", workers=1, progress=progress)
    assert len(lines(tmp_path / "out")) in (2, 3)
    assert batch.run(items(tmp_path, ["fine"] * 5, sleep=0.1), work, tmp_path / "out").counts == {"done": 5}


def test_a_torn_line_is_taken_away_wherever_it_is_torn(tmp_path):
    first, second = {"id": "a", "status": "done"}, {"id": "b", "status": "done"}
    with Journal(tmp_path, False) as journal:
        journal.add(first)
        if os.name != "nt":
            with pytest.raises(proxel.InputError, match="another batch writes it"):
                Journal(tmp_path, False)
    whole = (tmp_path / "results.jsonl").read_bytes()
    with Journal(tmp_path, False) as journal:
        journal.add(second)
    both = (tmp_path / "results.jsonl").read_bytes()
    for cut in range(len(whole), len(both)):
        (tmp_path / "results.jsonl").write_bytes(both[:cut])
        assert batch.read_results(tmp_path) == [first]
        with Journal(tmp_path, False) as journal:
            assert journal.records == {"a": first}
            journal.add(second)
        assert (tmp_path / "results.jsonl").read_bytes() == both
    (tmp_path / "results.jsonl").write_bytes(b"{}\n" + both)
    with pytest.raises(proxel.InputError, match="line 1 is no result"):
        Journal(tmp_path, False)
    with Journal(tmp_path, True) as journal:
        assert journal.records == {}


def test_manifests(tmp_path):
    (tmp_path / "list.jsonl").write_text(
        '# scans\n{"mesh": "a.obj", "method": "slim"}\n\n"b c.obj"\nd.obj\n'
        '{"id": "x/y", "mesh": "a.obj", "pins": [1]}\n'
    )
    got = batch.read_items(tmp_path / "list.jsonl", "unwrap")
    assert [i.id for i in got] == ["a.obj", "b c.obj", "d.obj", "x/y"]
    assert got[0].arguments == {"mesh": "a.obj", "method": "slim"} and got[3].arguments["pins"] == [1]
    assert got[1].path("b c.obj") == tmp_path / "b c.obj"
    (tmp_path / "list.csv").write_text('id,mesh,young,method\none,a.obj,1e5,"newton"\ntwo,"b,c.obj",,wrapd\n')
    one, two = batch.read_items(tmp_path / "list.csv", "deform")
    assert one.arguments == {"mesh": "a.obj", "young": 1e5, "method": "newton"}
    assert two.id == "two" and two.arguments == {"mesh": "b,c.obj", "method": "wrapd"}
    assert [i.id for i in batch.read_items([{"image": "a.npy"}, {"image": [[1.0]]}], "denoise")] == ["a.npy", "1"]
    for name, text, message in [
        ("l.jsonl", '"a.obj"\n{"mesh": 1', "line 2: it is no JSON"),
        ("l.jsonl", '"a.obj"\n{"method": "slim"}', "line 2: it has neither an `id` nor a 'mesh'"),
        ("l.jsonl", "a.obj\nb.obj\na.off", "item 2 .*'a.off' and 'a.obj'.* leave one file"),
        ("l.csv", "id,mesh\na", "line 2: it has not as many cells"),
        ("l.txt", "\n# nothing\n", "it has no items"),
        ("l.jsonl", '{"id": "a", "mesh": "out/a.npz"}', "would be written over it"),
    ]:
        (tmp_path / name).write_text(text)
        with pytest.raises(proxel.InputError, match=message):
            batch.read_items(tmp_path / name, "unwrap", tmp_path / "out")
    with pytest.raises(proxel.InputError, match="neither a folder nor a manifest"):
        batch.read_items(tmp_path / "nowhere", "unwrap")
    names = {str(batch._items.output_name(n)) for n in ("../a", "/b/c", "a:b", "d.v2.stl", "..", "é.obj")}
    assert names == {"a.npz", str(Path("b", "c.npz")), "a_3ab.npz", "d.v2.npz", "item.npz", "é.npz"}


def test_shards_share_the_items(tmp_path):
    todo = items(tmp_path, ["fine"] * 5)
    for k in range(2):
        records = batch.run(todo, work, tmp_path / f"out{k}", shard=(k, 2), workers=1)
        assert [r["id"] for r in records] == [f"i{j}" for j in range(k, 5, 2)]
    assert logged(tmp_path, "begin") == {f"i{k}": 1 for k in range(5)}


def test_every_job(tmp_path):
    """Each once, in one worker each, as the functions of the package do them."""
    V, F = patch(6)
    Q = quads(6)
    body = beam((2, 1, 1))
    ends = np.flatnonzero((body[0][:, 0] == 0) | (body[0][:, 0] == 3))
    image = np.random.default_rng(0).random((24, 24))
    scene = {
        "time": {"dt": 0.02, "frames": 1},
        "body": [{"name": "c", "generate": {"bar": {"cells": [1, 1, 1], "size": [1, 1, 1]}}}],
    }
    recipe = {"constraint": [{"kind": "planar"}, {"kind": "near", "weight": 1.0}]}
    near = {"max_iters": 200}
    jobs = {
        "deform": dict(V=body[0], T=body[1], pins=ends, targets=body[0][ends] * 1.1),
        "planarize": dict(V=V, F=Q, **near),
        "wire": dict(V=V, F=Q, **near),
        "shape": dict(V=V, F=Q, recipe=recipe),
        "geodesic": dict(V=V, F=F, sources=[0]),
        "denoise": dict(image=image, lambda_=5.0),
        "inpaint": dict(image=image, mask=image > 0.2, lambda_=5.0),
        "deblur": dict(image=image, psf="gaussian:1", lambda_=50.0),
        "wavefront": dict(reference=image, captured=image, **near),
        "simulate": dict(scene=scene),
    }
    np.save(tmp_path / "image.npy", image)
    for job, arguments in jobs.items():
        (record,) = batch.run([{"id": job, **arguments}], job, tmp_path / "out", workers=1)
        assert record["status"] in ("converged", "stopped"), (job, record)
        assert record["report"]["command"] == job and record["seconds"] > 0
        with np.load(tmp_path / "out" / f"{job}.npz") as arrays:
            got = {name: arrays[name] for name in arrays}
        if job == "simulate":
            assert got["c"].shape == (8, 3)
            continue
        expected, _ = getattr(proxel, job)(**{**arguments, "threads": 1})
        (name,) = {"X", "distance", "image", "phi"} & set(got)
        np.testing.assert_array_equal(got[name], expected)
    (record,) = batch.run([str(tmp_path / "image.npy")], "denoise", tmp_path / "two", settings={"lambda_": 5.0})
    assert record["id"] == str(tmp_path / "image.npy") and record["status"] == "converged"


def test_limits_of_jobs(tmp_path):
    V, T = beam((10, 4, 4))
    pins = np.flatnonzero((V[:, 0] == 0) | (V[:, 0] == 3))
    targets = np.where(V[pins, :1] == 0, V[pins], V[pins] * [1, -1, -1] + [1, 1, 1])
    endless = {"method": "admm-pd", "tol": 1e-300, "max_iters": 10**9, "young": 1e5}
    item = {"id": "long", "V": V, "T": T, "pins": pins, "targets": targets}
    (record,) = batch.run([item], "deform", tmp_path / "out", settings=endless, time_limit=0.3)
    assert record["status"] == "stopped" and "0.3 seconds" in record["reason"]
    with np.load(tmp_path / "out" / "long.npz") as arrays:
        assert np.isfinite(arrays["X"]).all()
    missing = batch.run([{"id": "a", "V": V}, {"mesh": "b.obj"}, {"mesh": "c.stl0"}], "unwrap", tmp_path / "two")
    assert [r["status"] for r in missing] == ["refused"] * 3
    assert "a: it has no `F`" in missing[0]["reason"] and "b.obj: it cannot be read" in missing[1]["reason"]


@posix
@pytest.mark.full
def test_a_job_that_needs_more_than_its_memory_is_told_from_a_crash(tmp_path):
    V, T = beam((80, 20, 20), (4.0, 1.0, 1.0))
    pins = np.flatnonzero((V[:, 0] == 0) | (V[:, 0] == 4))
    todo = [{"id": "fine", "V": beam()[0], "T": beam()[1], "pins": [0]}, {"id": "large", "V": V, "T": T, "pins": pins}]
    todo[1]["targets"] = V[pins] + np.where(V[pins, :1] == 4, [[0.4, 0.3, 0.0]], 0.0)
    records = batch.run(todo, "deform", tmp_path / "out", memory_limit="300M", workers=1)
    # Refused memory ends the compiled part by SIGABRT; in a worker that had done others it is tried in a fresh one.
    assert [(r["status"], r["signal"], r["attempts"]) for r in records] == [
        ("converged", None, 1),
        ("memory", signal.SIGABRT, 1),
    ]
    assert "memory allocation of" in records[1]["reason"]


def test_parquet(tmp_path, monkeypatch):
    todo = items(tmp_path, ["fine", "raise"])
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(proxel.InputError, match=r"results.parquet needs pyarrow; pip install 'proxel\[parquet\]'"):
        batch.run(todo, work, tmp_path / "out", parquet=True)
    assert not (tmp_path / "log").exists()
    monkeypatch.undo()
    parquet = pytest.importorskip("pyarrow.parquet")
    batch.run(todo, work, tmp_path / "out", parquet=True, workers=1)
    rows = parquet.read_table(tmp_path / "out" / "results.parquet").to_pylist()
    assert [(r["id"], r["status"], r["signal"]) for r in rows] == [("i0", "done", None), ("i1", "failed", None)]
    assert json.loads(rows[0]["report"])["name"] == "i0" and rows[0]["seconds"] >= 0


BAD = [
    (lambda out: batch.run([], "unwrap", out), "it has no items"),
    (lambda out: batch.run([1], "unwrap", out), r"item 0 \(0-based\): it is a int"),
    (lambda out: batch.run(["a"], "fly", out), "job is 'fly'; known are deblur"),
    (lambda out: batch.run(["a"], lambda item: None, out), "at the top level of a module"),
    (lambda out: batch.run(["a"], "unwrap", out, engine="dask"), "engine is 'dask'"),
    (lambda out: batch.run(["a"], "unwrap", out, memory_limit="much"), "memory_limit is 'much'"),
    (lambda out: batch.run(["a"], "unwrap", out, memory_limit="64M"), "memory_limit is 67108864 bytes"),
    (lambda out: batch.run(["a"], "unwrap", out, time_limit=-1.0), "time_limit is -1"),
    (lambda out: batch.run(["a"], "unwrap", out, shard=(2, 2)), "shard is"),
    (lambda out: batch.run(["a"], "unwrap", out, workers=0), "workers is 0"),
    (lambda out: batch.run({"a": 1}, "unwrap", out), "give a folder, a manifest or a list"),
    (lambda out: batch.read_results(out / "nowhere"), "cannot be read"),
]


@pytest.mark.parametrize("number", range(len(BAD)))
def test_bad_batches_name_the_item_and_the_remedy(tmp_path, number):
    call, text = BAD[number]
    with pytest.raises(proxel.InputError, match=text):
        call(tmp_path)
