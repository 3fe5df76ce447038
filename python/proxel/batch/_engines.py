"""Where items run: on this machine, or on the nodes of a Ray cluster.

An engine keeps the record of each item as it ends, and then yields it. What has ended when an engine is closed has been
kept.
"""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from .._extras import extra
from ._supervise import Limits, Worker, _record, run_item

#: How often an item is given out again because its machine was lost, which is no fault of its own.
LOSSES = 5
#: Between two looks, in which Ctrl-C is heard.
LOOK_SECONDS = 0.5

Tasks = Sequence[dict[str, Any]]
Keep = Callable[[dict[str, Any]], None]


def local(tasks: Tasks, limits: Limits, workers: int, keep: Keep) -> Iterator[dict[str, Any]]:
    """A thread for each worker process, which waits for it, and keeps records: Ctrl-C comes to the main thread alone,
    so that it cannot come between the end of an item and its record."""
    waiting: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    for task in tasks:
        waiting.put(task)
    ended: queue.SimpleQueue[dict[str, Any] | BaseException | None] = queue.SimpleQueue()
    stop = threading.Event()

    def serve() -> None:
        kept: list[Worker] = []
        try:
            while not stop.is_set():
                task = waiting.get_nowait()
                record = run_item(task, limits, kept, stop)
                if record is not None:
                    keep(record)
                    ended.put(record)
        except queue.Empty:
            pass
        except BaseException as e:
            ended.put(e)
        finally:
            for worker in kept:
                worker.kill()
            ended.put(None)

    threads = [threading.Thread(target=serve, daemon=True) for _ in range(min(workers, len(tasks)))]
    for thread in threads:
        thread.start()
    running = len(threads)
    try:
        while running:
            try:
                answer = ended.get(timeout=LOOK_SECONDS)
            except queue.Empty:
                continue
            if answer is None:
                running -= 1
            elif isinstance(answer, BaseException):
                raise answer
            else:
                yield answer
    finally:
        # Ctrl-C, or whoever takes the records has enough: no process is left behind.
        stop.set()
        for thread in threads:
            thread.join()


def ray(tasks: Tasks, limits: Limits, workers: int | None, keep: Keep) -> Iterator[dict[str, Any]]:
    """A Ray task for each item, `workers` at a time (what the cluster has room for), each in a process below Ray's."""
    cluster = extra("ray", "ray", "engine='ray'")
    if not cluster.is_initialized():
        cluster.init(log_to_driver=False)
    options: dict[str, Any] = {"num_cpus": limits.threads, "max_retries": 0}
    if limits.memory is not None:
        options["memory"] = limits.memory
    remote = cluster.remote(**options)(run_item)
    waiting = deque(tasks)
    losses: dict[str, int] = {}
    running: dict[Any, dict[str, Any]] = {}
    try:
        while waiting or running:
            # As many as there is room for, and as many again, so that no node waits for this one.
            room = workers or 2 * max(1, int(cluster.cluster_resources().get("CPU", 1)) // limits.threads)
            while waiting and len(running) < room:
                task = waiting.popleft()
                running[remote.remote(task, limits)] = task
            ready, _ = cluster.wait(list(running), num_returns=1, timeout=LOOK_SECONDS)
            for reference in ready:
                task = running.pop(reference)
                name = task["item"].id
                try:
                    record = cluster.get(reference)
                # What an item does wrong is in its record; an error here is one of the machine, or of Ray.
                except cluster.exceptions.RayTaskError:
                    raise
                except cluster.exceptions.RayError as e:
                    losses[name] = losses.get(name, 0) + 1
                    if losses[name] <= LOSSES:
                        waiting.append(task)
                        continue
                    reason = f"its machine was lost {losses[name]} times: {type(e).__name__}"
                    record = _record(task, {"status": "crashed", "reason": reason}, losses[name], 0.0)
                record["losses"] = losses.get(name, 0)
                keep(record)
                yield record
    finally:
        for reference in running:
            cluster.cancel(reference, force=True)
