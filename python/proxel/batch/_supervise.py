"""One item in a process of its own, under limits of time and memory."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from typing import IO, Any, NamedTuple

from ._child import receive, send
from ._jobs import has_time_limit

#: What is kept of a worker's messages.
KEPT_BYTES = 8192
#: Between two looks whether the batch is to end.
LOOK_SECONDS = 0.1
#: Between the closing of its pipe and the end of a worker.
CLOSING_SECONDS = 1.0
#: A worker that says nothing at all for so long has not started.
START_SECONDS = 120.0
#: What an allocator says before it aborts the process, in Rust, in C++ and in numpy's libraries.
OUT_OF_MEMORY = ("memory allocation of", "bad_alloc", "Memory allocation still failed", "Cannot allocate memory")
#: The program of a worker: the modules that its parent finds, it finds too.
PROGRAM = (
    "import json, os, sys; sys.path[:] = json.loads(os.environ.pop('PROXEL_WORKER_PATH')); "
    "from proxel.batch._child import main; main()"
)
#: Variables that say how many threads libraries take.
THREADS = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Limits(NamedTuple):
    """What an item may take."""

    time: float | None = None  # s, after which a job stops with the best so far
    memory: int | None = None  # bytes of the process
    threads: int = 1
    retries: int = 0  # after it crashed, was killed or ran out of memory

    def seconds_to_kill(self, asks: bool) -> float | None:
        """When the process is killed: a job that stops by itself has twice the time and ten seconds more."""
        if self.time is None:
            return None
        return 2.0 * self.time + 10.0 if asks else self.time


class Died(Exception):
    """A worker that ended before it answered."""

    def __init__(self, code: int | None, messages: str) -> None:
        super().__init__(code, messages)
        self.code, self.messages = code, messages


class Worker:
    """A process that does items, one after the other."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.done = 0  # items so far
        environment = {**os.environ, "PROXEL_WORKER_PATH": json.dumps(sys.path)}
        environment.update(dict.fromkeys(THREADS, str(limits.threads)))
        self._process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment,
            # A group of its own: the Ctrl-C of a terminal comes to the parent only, and a kill takes grandchildren too.
            start_new_session=True,
        )
        self._messages = bytearray()
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        out, errors = self._process.stdout, self._process.stderr
        self._threads = [
            threading.Thread(target=self._hear, args=(out,), daemon=True),
            threading.Thread(target=self._keep, args=(errors,), daemon=True),
        ]
        for thread in self._threads:
            thread.start()
        self._tell(limits.memory)

    def _hear(self, stream: IO[bytes]) -> None:
        try:
            while True:
                self._answers.put(receive(stream))  # type: ignore[arg-type]
        except (EOFError, OSError, ValueError):
            self._answers.put(None)

    def _keep(self, stream: IO[bytes]) -> None:
        """Reads to the end, so that the writer never waits, and keeps the end."""
        while data := stream.read1(4096):  # type: ignore[attr-defined]
            self._messages += data
            del self._messages[:-KEPT_BYTES]

    def _tell(self, message: Any) -> None:
        try:
            send(self._process.stdin, message)  # type: ignore[arg-type]
        except (BrokenPipeError, OSError):
            # Its death is seen where its answer is waited for.
            pass

    def call(self, task: dict[str, Any], seconds: float | None, stop: threading.Event | None) -> dict[str, Any] | None:
        """Has a task done: its answer, or None where the batch is to end. Raises Died, and TimeoutError after
        `seconds`. After each of these the worker is gone."""
        self._tell(task)
        # Until it says that it has begun it is starting, which is no time of the item.
        end: float | None = time.monotonic() + START_SECONDS
        what = f"its process had not started after {START_SECONDS:g} seconds"
        while True:
            try:
                answer: dict[str, Any] | None = self._answers.get(timeout=LOOK_SECONDS)
            except queue.Empty:
                if stop is not None and stop.is_set():
                    self.kill()
                    return None
                if end is not None and time.monotonic() > end:
                    self.kill()
                    raise TimeoutError(what) from None
                continue
            if answer is None:
                # Its end of the pipe is closed before it is gone; its own status is wanted, not that of a kill.
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(CLOSING_SECONDS)
                raise Died(self.kill(), self.messages)
            if "begun" in answer:
                end = None if seconds is None else time.monotonic() + seconds
                what = f"killed after {seconds} seconds"
                continue
            self.done += 1
            return answer

    @property
    def alive(self) -> bool:
        """Whether it can be given a task."""
        return self._process.poll() is None

    @property
    def messages(self) -> str:
        return self._messages.decode(errors="replace").strip()

    def kill(self) -> int | None:
        """Ends the process and all that it started; its exit status, negative for a signal."""
        # One that has ended by itself keeps its status.
        code = self._process.poll()
        try:
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
            else:
                self._process.kill()
        except (ProcessLookupError, PermissionError):
            pass
        code = self._process.wait() if code is None else code
        for thread in self._threads:
            thread.join(1.0)
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            try:
                if stream is not None:
                    stream.close()
            except OSError:
                pass
        return code


_kept: list[Worker] = []


def run_item(
    task: dict[str, Any], limits: Limits, workers: list[Worker] | None = None, stop: threading.Event | None = None
) -> dict[str, Any] | None:
    """Does one item in a worker, and gives its record; None where `stop` was set before it ended.

    `task` has the `item`, its `job`, `settings`, `out`, `preview`, `digest` and the `path` of modules. `workers` keeps
    the worker from one item to the next; without it this process keeps one. It is replaced where it died or was
    killed. The same function runs on this machine and on the nodes of a cluster.
    """
    kept = _kept if workers is None else workers
    seconds = limits.seconds_to_kill(has_time_limit(task["job"]))
    attempts = 0
    while True:
        if kept and (kept[0].limits != limits or not kept[0].alive):
            kept.pop().kill()
        if not kept:
            kept.append(Worker(limits))
        worker = kept[0]
        alone = worker.done == 0
        attempts += 1
        begun = time.monotonic()
        try:
            answer = worker.call(task, seconds, stop)
        except Died as e:
            answer = _of_death(e, limits)
        except TimeoutError as e:
            # Windows has no signals; there a process is terminated.
            answer = {"status": "timeout", "reason": str(e), "signal": getattr(signal, "SIGKILL", None)}
        if answer is None:
            kept.clear()
            return None
        if answer["status"] in ("memory", "crashed", "timeout"):
            # What it has taken, or damaged, the next item must not find.
            kept.pop().kill()
            # In a worker that had done other items what they left may be to blame: that attempt does not count.
            if not alone and answer["status"] == "memory":
                attempts -= 1
                continue
            if attempts <= limits.retries:
                continue
        return _record(task, answer, attempts, time.monotonic() - begun)


def _of_death(e: Died, limits: Limits) -> dict[str, Any]:
    """What is known of a process that ended before it answered."""
    last = e.messages.splitlines()[-1].strip() if e.messages else ""
    number = -e.code if e.code is not None and e.code < 0 else None
    said = f": {last}" if last else ""
    wanted = [line.strip() for line in e.messages.splitlines() if any(text in line for text in OUT_OF_MEMORY)]
    if limits.memory is not None and wanted:
        return {
            "status": "memory",
            "reason": f"it met its limit of {limits.memory} bytes: {wanted[0]}",
            "signal": number,
        }
    if number is None:
        return {"status": "crashed", "reason": f"its process ended by exit status {e.code}{said}", "exit_code": e.code}
    try:
        name = signal.Signals(number).name
    except ValueError:
        name = f"signal {number}"
    hint = "; the system kills so what takes the last memory" if name == "SIGKILL" else ""
    return {"status": "crashed", "reason": f"its process ended by {name}{hint}{said}", "signal": number}


def _record(task: dict[str, Any], answer: dict[str, Any], attempts: int, seconds: float) -> dict[str, Any]:
    job = task["job"]
    return {
        "id": task["item"].id,
        "job": job.name if job.module is None else f"{job.module}:{job.name}",
        "status": answer["status"],
        "reason": answer["reason"],
        "attempts": attempts,
        "signal": answer.get("signal"),
        "exit_code": answer.get("exit_code"),
        "seconds": round(answer.get("seconds", seconds), 6),
        "peak_bytes": answer.get("peak_bytes"),
        "out": answer.get("out"),
        "node": socket.gethostname(),
        "digest": task["digest"],
        "report": answer.get("report"),
    }
