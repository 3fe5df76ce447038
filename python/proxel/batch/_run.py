"""The batch itself: what is to be done, what has been done, and who hears of it."""

from __future__ import annotations

import math
import os
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from .._core import InputError
from . import _engines
from ._items import Item, digest, read_items
from ._jobs import has_time_limit, job_of
from ._journal import Journal, require_parquet, write_parquet
from ._supervise import Limits

#: Less than this and not even Python and numpy start.
LEAST_MEMORY = 256 << 20
#: Statuses that `retry_failed` does again.
GOOD = ("done", "converged")
UNITS = {"K": 10, "M": 20, "G": 30, "T": 40}


class Progress(NamedTuple):
    """Where a batch stands when an item has ended."""

    done: int  # items that have ended, those of earlier runs too
    total: int  # items of the batch
    record: dict[str, Any]  # of the item that has ended
    counts: dict[str, int]  # items by status


class Records(list[dict[str, Any]]):
    """The records of a batch, in the order of its items: as lines of `results.jsonl`."""

    @property
    def counts(self) -> dict[str, int]:
        """How many ended with each status."""
        return dict(Counter(str(r["status"]) for r in self))

    def __getitem__(self, which: Any) -> Any:
        """By place, or by the id of an item."""
        if isinstance(which, str):
            for record in self:
                if record["id"] == which:
                    return record
            raise KeyError(which)
        return super().__getitem__(which)

    def __repr__(self) -> str:
        return f"<Records of {len(self)} items: {', '.join(f'{n} {s}' for s, n in self.counts.items()) or 'none'}>"


def run(
    source: Any,
    job: str | Callable[[Item], Any],
    out: str | os.PathLike[str],
    *,
    settings: Mapping[str, Any] | None = None,
    engine: str = "local",
    workers: int | None = None,
    threads: int = 1,
    time_limit: float | None = None,
    memory_limit: int | str | None = None,
    retries: int = 0,
    fresh: bool = False,
    retry_failed: bool = False,
    shard: tuple[int, int] | None = None,
    preview: bool = False,
    parquet: bool = False,
    progress: Callable[[Progress], object] | None = None,
) -> Records:
    """Does a job to every item of `source`, each in a process that may crash, hang or run out of memory alone.

    `source` is a folder (searched with all below it), a manifest (.jsonl, .csv, .txt) or a list of dicts and paths.
    The keys of an item are its `id`, `mesh` (.npz with V and F or T, .obj, .off; others through meshio) or what else
    the job takes, and settings that differ from `settings`, which are those of all; texts that end in .npy are read as
    arrays. `job` is "unwrap", "deform", "planarize", "wire", "shape", "geodesic", "deblur", "denoise", "inpaint",
    "wavefront" or "simulate", or a function of the top level of a module, which is given the `Item` and returns a dict
    of arrays and of what JSON can have, or None.

    `out` gets OUT/id.npz with the arrays, with `preview` OUT/id.png, and a line of `results.jsonl` as each item ends.
    The same call again does only what has not ended, or whose files, arguments or job have changed; `retry_failed` does
    again what is neither "done" nor "converged", `fresh` all. Limits, threads and workers may change. An item that was
    running when a batch was broken off is done again; none has two lines for one end. `parquet` writes
    `results.parquet` besides (`proxel[parquet]`).

    `workers` processes (one for each `threads` processors) have `threads` each. After `time_limit` seconds a job stops
    with the best so far (status "stopped") and is killed after twice the time and ten seconds more ("timeout"); a
    function is killed after `time_limit`. `memory_limit`, in bytes or as "4G", is what a process may take: RLIMIT_DATA
    on Linux, RLIMIT_AS on other systems of POSIX, which counts reserved addresses too; on Windows there is none.
    `retries` is how often an item is tried again that crashed, was killed or ran out of memory. `shard=(i, n)` is every
    n-th item from the i-th on, each shard with an `out` of its own.

    `progress` is called with a `Progress` as each item ends, in the thread of the caller; what it raises ends the
    batch, as Ctrl-C does: what has ended is kept, and processes are gone when `run` is. `engine="ray"` runs items on
    a Ray cluster (`ray.init` beforehand, or one on this machine), where files and `out` have to be on disks that
    all nodes share; an item whose node is lost is given to another, which is no retry.

    Returns the records in the order of the items. Raises InputError for what is no batch, KeyboardInterrupt on Ctrl-C.
    """
    what = job_of(job)
    items = _shard(read_items(source, what.name if what.module is None else None, out), shard)
    if engine not in ("local", "ray"):
        raise InputError(f"engine is {engine!r}; give 'local' or 'ray'")
    limits = _limits(time_limit, memory_limit, threads, retries)
    if workers is not None and workers < 1:
        raise InputError(f"workers is {workers}; give 1 or more")
    if parquet:
        require_parquet()
    common = dict(settings or {})
    name = what.name if what.module is None else f"{what.module}:{what.name}"
    # Limits are not part of it: what has ended is not done again because they have changed.
    digests = [digest(item, name, {**common, **({} if preview is False else {"preview": True})}) for item in items]
    if has_time_limit(what):
        common.setdefault("threads", threads)
        if time_limit is not None:
            common.setdefault("time_limit", float(time_limit))
    folder = Path(out).absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"{folder}: it cannot be made: {e.strerror}; give another folder") from e
    common_task = {"job": what, "settings": common, "out": str(folder), "preview": preview, "path": sys.path}
    with Journal(folder, fresh) as journal:
        tasks = []
        for item, sha in zip(items, digests):
            before = journal.records.get(item.id)
            if before is None or before.get("digest") != sha or (retry_failed and before["status"] not in GOOD):
                journal.records.pop(item.id, None)
                tasks.append({**common_task, "item": item, "digest": sha})
        done = len(items) - len(tasks)
        counts = Counter(str(journal.records[i.id]["status"]) for i in items if i.id in journal.records)
        if tasks:
            count = workers or max(1, (os.cpu_count() or 1) // threads)
            if engine == "local":
                records = _engines.local(tasks, limits, count, journal.add)
            else:
                records = _engines.ray(tasks, limits, workers, journal.add)
            try:
                for record in records:
                    done += 1
                    counts[record["status"]] += 1
                    if progress is not None:
                        progress(Progress(done, len(items), record, dict(counts)))
            finally:
                records.close()  # type: ignore[attr-defined]
        ended = Records(journal.records[i.id] for i in items if i.id in journal.records)
    if parquet:
        write_parquet(ended, folder / "results.parquet")
    return ended


def _shard(items: list[Item], shard: tuple[int, int] | None) -> list[Item]:
    if shard is None:
        return items
    index, count = shard
    if not 0 <= index < count:
        raise InputError(f"shard is {shard}; give (i, n) with 0 <= i < n")
    return items[index::count]


def _limits(time: float | None, memory: int | str | None, threads: int, retries: int) -> Limits:
    if time is not None and not 0 < time < math.inf:
        raise InputError(f"time_limit is {time}; give seconds above 0, or leave it out")
    if threads < 1 or retries < 0:
        raise InputError(f"threads is {threads} and retries {retries}; give at least 1 and 0")
    size = _bytes(memory) if isinstance(memory, str) else memory
    if size is not None:
        if os.name == "nt":
            raise InputError("memory_limit: memory cannot be limited on this system; leave it out")
        if size < LEAST_MEMORY:
            raise InputError(f"memory_limit is {size} bytes; Python and numpy need {LEAST_MEMORY}; give more")
    return Limits(time, size, threads, retries)


def _bytes(text: str) -> int:
    """ "4G", "512M", "1073741824": powers of 1024."""
    plain = text.strip().upper().removesuffix("IB").removesuffix("B")
    digits, shift = (plain[:-1], UNITS[plain[-1]]) if plain[-1:] in UNITS else (plain, 0)
    if not digits.isdecimal():
        raise InputError(f"memory_limit is {text!r}; give bytes, such as 4294967296, '4G' or '512M'")
    return int(digits) << shift
