"""The program of a worker: reads tasks from its standard input, and answers where its standard output was.

Each message is a pickle after its length in eight bytes. What a task prints goes to standard error.
"""

from __future__ import annotations

import importlib
import os
import pickle
import queue
import runpy
import struct
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, BinaryIO

LENGTH = struct.Struct("<Q")


def send(stream: BinaryIO, message: Any) -> None:
    data = pickle.dumps(message)
    stream.write(LENGTH.pack(len(data)) + data)
    stream.flush()


def receive(stream: BinaryIO) -> Any:
    """The next message; EOFError where the other end is gone."""
    head = stream.read(LENGTH.size)
    if len(head) < LENGTH.size:
        raise EOFError
    (length,) = LENGTH.unpack(head)
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return pickle.loads(data)


def main() -> None:
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    tasks: queue.SimpleQueue[Any] = queue.SimpleQueue()
    # Ctrl-C of a terminal is the parent's business.
    limit_memory(receive(sys.stdin.buffer))
    threading.Thread(target=_listen, args=(tasks,), daemon=True).start()
    functions: dict[Any, Callable[[Any], Any]] = {}
    # Before the first item, whose time it would be.
    from . import _jobs  # noqa: F401

    while True:
        task = tasks.get()
        send(answers, {"begun": True})
        send(answers, _answer(task, functions))


def _listen(tasks: queue.SimpleQueue[Any]) -> None:
    """A worker whose parent is gone ends at once, whatever it is doing: nobody would take its answer."""
    try:
        while True:
            tasks.put(receive(sys.stdin.buffer))
    except EOFError:
        os._exit(0)
    except BaseException as e:
        print(f"a task cannot be understood: {type(e).__name__}: {e}", file=sys.stderr, flush=True)
        os._exit(70)


def limit_memory(limit: int | None) -> None:
    try:
        import resource
    except ImportError:  # Windows, where a limit was refused before
        return
    # Thousands of items must not leave thousands of core files.
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if limit is not None:
        # On Linux data are all private memory that can be written, which is what is used; the address space also has
        # what allocators reserve for each thread. Elsewhere data are less than what is allocated.
        kind = resource.RLIMIT_DATA if sys.platform == "linux" else resource.RLIMIT_AS
        resource.setrlimit(kind, (limit, limit))


def _answer(task: dict[str, Any], functions: dict[Any, Callable[[Any], Any]]) -> dict[str, Any]:
    from .._core import InputError, SolveError
    from ._jobs import execute

    _reset_peak()
    begun = time.monotonic()
    try:
        job = task["job"]
        function = None
        if job.module is not None:
            if job not in functions:
                # On other machines what the program finds may not be on the path yet.
                sys.path += [p for p in task["path"] if p not in sys.path]
                functions[job] = _find(job)
            function = functions[job]
        answer = execute(task["item"], job, task["settings"], function, task["out"], task["preview"])
    except MemoryError as e:
        answer = {"status": "memory", "reason": f"{type(e).__name__}: {e}"}
    except InputError as e:
        answer = {"status": "refused", "reason": str(e)}
    except SolveError as e:
        answer = {"status": "failed", "reason": str(e)}
    except Exception as e:
        answer = {"status": "failed", "reason": f"{type(e).__name__}: {e}"}
    return {**answer, "seconds": time.monotonic() - begun, "peak_bytes": _peak()}


def _find(job: Any) -> Callable[[Any], Any]:
    if job.main is None:
        found: Callable[[Any], Any] = getattr(importlib.import_module(job.module), job.name)
        return found
    # The script once more, but not as the program: what it does `if __name__ == "__main__"` is not done again.
    names = runpy.run_path(job.main, run_name="__proxel_worker__")
    script: Callable[[Any], Any] = names[job.name]
    return script


def _reset_peak() -> None:
    """Linux forgets the largest memory so far, so that it is that of the item."""
    try:
        with open("/proc/self/clear_refs", "w") as file:
            file.write("5")
    except OSError:
        pass


def _peak() -> int | None:
    try:
        with open("/proc/self/status") as file:
            for line in file:
                if line.startswith("VmHWM:"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    return None
