"""What every run has: errors, callbacks, limits, Ctrl-C, jobs, settings."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import beam, patch, sphere

import proxel

HERE = Path(__file__).parent


def long_run(**keywords):
    """A run that goes on for minutes: a method of first order on what hardly changes its volume."""
    V, T = beam((10, 4, 4))
    pins = np.flatnonzero((V[:, 0] == 0) | (V[:, 0] == 3))
    targets = np.where(V[pins, :1] == 0, V[pins], V[pins] * [1, -1, -1] + [1, 1, 1])
    settings = {"method": "admm-pd", "tol": 1e-300, "max_iters": 10**9, "poisson": 0.49, **keywords}
    return proxel.deform(V, T, pins=pins, targets=targets, **settings)


def test_a_callback_hears_every_iteration_and_ends_the_run():
    heard = []
    thread = threading.get_ident()

    def callback(progress):
        assert threading.get_ident() == thread
        heard.append((progress.iteration, progress.energy, progress.inverted))
        return progress.iteration >= 5

    X, info = long_run(callback=callback)
    assert [h[0] for h in heard] == [0, 1, 2, 3, 4, 5]
    assert info.status == "cancelled" and np.isfinite(X).all() and info.iterations == 5
    assert all(np.isfinite(h[1]) for h in heard)


def test_what_a_callback_raises_is_raised_after_the_run():
    def callback(progress):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        long_run(callback=callback)


def test_a_time_limit_keeps_the_best_so_far():
    X, info = long_run(time_limit=0.2)
    assert info.status == "stopped" and "0.2 seconds" in info.reason and np.isfinite(X).all()
    X, info = long_run(max_iters=7)
    assert info.status == "stopped" and info.iterations == 7


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c():
    """In a process of its own, with the default handler, without a callback."""
    # Where the tests run in the background of a shell the signal is ignored, and processes inherit that.
    code = "import signal, test_run; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code += "; print('begun', flush=True); test_run.long_run()"
    command, pipe = [sys.executable, "-c", code], subprocess.PIPE
    run = subprocess.Popen(command, cwd=HERE, stdout=pipe, stderr=pipe, text=True)
    try:
        assert run.stdout.readline() == "begun\n"
        time.sleep(0.5)
        assert run.poll() is None
        run.send_signal(signal.SIGINT)
        _, errors = run.communicate(timeout=60)
    finally:
        run.kill()  # else what does not hear goes on for ever
    assert errors.strip().endswith("KeyboardInterrupt") and run.returncode in (1, 130, -signal.SIGINT)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_handlers_of_signals_run_while_a_run_solves():
    """The lock is free: a handler runs in this thread, an alarm is what it is woken by."""
    heard = []
    cancel = proxel.Cancel()

    def handler(number, frame):
        heard.append(number)
        cancel.cancel()

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        X, info = long_run(cancel=cancel)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert heard == [signal.SIGALRM] and info.status == "cancelled"


def test_the_lock_is_free_while_a_run_solves():
    ticks = []
    cancel = proxel.Cancel()

    def count():
        for _ in range(20):
            time.sleep(0.005)
            ticks.append(1)
        cancel.cancel()

    thread = threading.Thread(target=count)
    thread.start()
    _, info = long_run(cancel=cancel)
    thread.join()
    assert len(ticks) == 20 and info.status == "cancelled" and cancel.cancelled


def test_a_job():
    job = proxel.Job(long_run)
    while job.progress is None or job.progress.iteration < 3:
        assert not job.wait(0.01)
    with pytest.raises(TimeoutError):
        job.result(0.01)
    job.cancel()
    X, info = job.result(60)
    assert job.done and info.status == "cancelled" and info.iterations >= 3
    V, F = patch(8)
    uv, info = proxel.Job(proxel.unwrap, V, F).result()
    np.testing.assert_array_equal(uv, proxel.unwrap(V, F)[0])
    with pytest.raises(proxel.InputError):
        proxel.Job(proxel.unwrap, V, F + 1000).result()


def test_several_threads_of_python_at_once():
    V, F = patch(12)
    expected, _ = proxel.unwrap(V, F)
    jobs = [proxel.Job(proxel.unwrap, V, F, threads=1 + k % 2) for k in range(6)]
    for job in jobs:
        np.testing.assert_array_equal(job.result()[0], expected)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_forked_process_solves_too(tmp_path):
    """Threads of the parent are not there in a child; the package keeps none between calls."""
    code = (
        "import multiprocessing as m, sys, test_run as t, proxel\n"
        "V, F = t.patch(12)\n"
        "def run(_):\n"
        "    uv, info = proxel.unwrap(V, F)\n"
        "    info.save_preview(sys.argv[1])\n"
        "    return uv.tobytes()\n"
        "here = run(0)\n"
        "with m.get_context('fork').Pool(2) as pool:\n"
        "    assert pool.map(run, range(4)) == [here] * 4\n"
    )
    command = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", code, str(tmp_path / "uv.png")]
    subprocess.run(command, cwd=HERE, check=True, timeout=300)


V, F = patch(4)
T = beam((1, 1, 1))
BAD = [
    (lambda: proxel.unwrap(V, F, foo=1), "no setting `foo`; known are admm, "),
    (lambda: proxel.unwrap(V, F, admm={"kapa": 1.0}), "setting `admm`.*`kapa`.*`kappa`"),
    (lambda: proxel.unwrap(V, F, method="magic"), "setting `method`.*`magic`.*`slim`"),
    (lambda: proxel.unwrap(V, F, tol="small"), "setting `tol`"),
    (lambda: proxel.unwrap(V, F, tol=float("nan")), "setting `tol`: it is NaN"),
    (lambda: proxel.unwrap(V, F, tol=-1.0), "tol is -1"),
    (lambda: proxel.unwrap(V, F, energy=object()), "setting `energy`: a object is no setting"),
    (lambda: proxel.unwrap(V, F, threads=0), "threads is 0"),
    (lambda: proxel.unwrap(V, np.where(F == 7, -3, F)), r"F: face \d+ \(0-based\) has the index -3"),
    (lambda: proxel.unwrap(V, np.where(F == 7, 99, F)), "vertex index 99 is out of range"),
    (lambda: proxel.unwrap(V, F + 0.5), "has the index 0.5"),
    (lambda: proxel.unwrap(V, F[:, :2]), "F|face"),
    (lambda: proxel.unwrap(V, F.astype(complex)), "F: its numbers are of type complex128"),
    (lambda: proxel.unwrap(V.astype(str), F), "V: its numbers are of type"),
    (lambda: proxel.unwrap(V.ravel(), F), r"V: its shape is \(75,\)"),
    (lambda: proxel.unwrap(np.where(np.arange(25)[:, None] == 7, np.inf, V), F), "vertex 7 .*inf"),
    (lambda: proxel.unwrap(V, []), "no face"),
    (lambda: proxel.unwrap(V, [[0, 1, 2], [0, 1, 2, -6]]), "face 1.*-6"),
    (lambda: proxel.unwrap(V, F, pins=[1]), "pins and targets belong together"),
    (lambda: proxel.unwrap(V, F, pins=[1], targets=[[0, 0], [1, 1]]), "there are 2 for 1 pins"),
    (lambda: proxel.unwrap(V, F, seams=[[0, 24]]), "0.*24"),
    (lambda: proxel.unwrap(V, F, weights=[1.0, 2.0]), "weights: its shape"),
    (lambda: proxel.deform(*T, pins=[99]), "pins: vertex 99 does not exist"),
    (lambda: proxel.deform(*T, pins=[0], targets=[[0, 0, np.nan]]), "NaN|not finite|finite"),
    (lambda: proxel.deform(*T, pins=[3, 3], targets=[[0, 0, 0], [0, 0, 1]]), "vertex 3 "),
    (lambda: proxel.deform(T[0], T[1][:, [0, 2, 1, 3]]), "volume"),
    (lambda: proxel.deform(*T, material="jelly"), "jelly"),
    (lambda: proxel.deform(*T, poisson=0.5), "0.5"),
    (lambda: proxel.deform(*T, start=T[0][:3]), "start: it has 3 rows"),
    (lambda: proxel.deform(T[0], np.zeros((1, 5), int)), "rows of 5"),
    (lambda: proxel.deform(*T, pins={"groups": {"a": {"indices": [0], "tanslate": [0, 0, 1]}}}), "tanslate"),
    (lambda: proxel.deform(*T, pins="nowhere.toml"), "nowhere.toml"),
    (lambda: proxel.geodesic(V, F, [25]), "25"),
    (lambda: proxel.planarize(V, F, fairness=1), "no setting `fairness`"),
    (lambda: proxel.wire(V, F, edge_len=1), "no setting `edge_len`"),
    (lambda: proxel.wire(V, F, edge_length=-1.0), "edge-length is -1"),
    (lambda: proxel.denoise(np.zeros((4,))), "image: its shape"),
    (lambda: proxel.denoise(np.full((8, 8), np.nan)), "row 0, column 0"),
    (lambda: proxel.wavefront(np.zeros((32, 32)), np.zeros((16, 32))), "32"),
    (lambda: proxel.settings("fly"), "no settings of `fly`"),
]


@pytest.mark.parametrize("number", range(len(BAD)))
def test_bad_input_is_an_input_error_with_the_item(number):
    call, text = BAD[number]
    with pytest.raises(proxel.InputError, match=text) as caught:
        call()
    assert isinstance(caught.value, ValueError) and "\n" not in str(caught.value)


def test_input_is_never_changed():
    V, F = sphere(1)
    v, f = V.copy(), F.copy()
    proxel.unwrap(V, F)
    proxel.deform(V, F, pins=[0, 1], targets=[[2, 0, 0], [-1, 0, 0]], resolution=6, max_iters=3)
    np.testing.assert_array_equal(V, v)
    np.testing.assert_array_equal(F, f)


def test_info_is_the_report(tmp_path):
    V, F = patch(6)
    _, info = proxel.unwrap(V, F, tol=1e-8)
    report = info.to_dict()
    for key, value in report.items():
        assert getattr(info, key) == value, key
    assert report["settings"] == {**proxel.settings("unwrap"), "tol": 1e-8}
    assert info.version == proxel.__version__ and info.command == "unwrap" and "converged" in repr(info)
    assert info.seconds["solve"] >= 0 and info.threads >= 1
    with pytest.raises(AttributeError, match="no `speed`"):
        info.speed
    other = pickle.loads(pickle.dumps(info))
    assert other.to_dict() == report
    np.testing.assert_array_equal(other.uv_faces, info.uv_faces)
    with pytest.raises(proxel.InputError):
        other.save_preview(tmp_path / "uv.png")


def test_settings_have_the_defaults_of_their_method():
    assert proxel.settings("planarize")["mu"] == 1e5 and proxel.settings("planarize", method="shapeup")["mu"] == 150
    assert proxel.settings("wire", method="aadr")["mu"] == 1e4
    assert proxel.settings("deform", schedule="paper")["admm"]["precision"] == "double"
    named = proxel.settings("deform", material="arap", young=5.0, poisson=0.0)["material"]
    assert (named["energy"], named["young"], named["poisson"]) == ("arap", 5.0, 0.0)
    deep = proxel.settings("unwrap", admm={"kappa": np.float32(0.5)}, max_iters=np.int64(3))
    assert deep["admm"]["kappa"] == 0.5 and deep["admm"]["window"] == 6 and deep["max_iters"] == 3
    assert proxel.settings("denoise", range=np.array([0, 1]))["range"] == [0.0, 1.0]


def test_the_stub_of_the_settings_is_up_to_date():
    tool = HERE.parent / "tools" / "settings_stub.py"
    assert subprocess.run([sys.executable, tool, "--check"], capture_output=True, text=True).returncode == 0


def test_types():
    """The package is typed: mypy, strictly, over it and over a script that uses it wrongly once."""
    pytest.importorskip("mypy")
    root = HERE.parent
    run = subprocess.run([sys.executable, "-m", "mypy", "proxel"], cwd=root, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout
    call = "import numpy as np, proxel\nuv, info = proxel.unwrap(np.eye(3), [[0, 1, 2]], %s)\ns: str = info.status\n"
    good, wrong = call % "tol=1e-6", call % "tlo=1e-6"
    for text, ok in ((good, True), (wrong, False)):
        command = [sys.executable, "-m", "mypy", "--config-file=", "-c", text]
        run = subprocess.run(command, cwd=root, capture_output=True, text=True)
        assert (run.returncode == 0) == ok, run.stdout


def test_the_package_is_quick_to_import_and_needs_numpy_only():
    """No module outside of the standard library, numpy and the package itself."""
    code = (
        "import sys, numpy; before = set(sys.modules); import proxel;"
        "new = {m.split('.')[0] for m in set(sys.modules) - before};"
        "print(*sorted(m for m in new if m not in sys.stdlib_module_names and m not in ('proxel', 'numpy')))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env={**os.environ})
    assert out.stdout.strip() == ""
