"""What has been done: `results.jsonl`, a line for each item as it ends.

A line is one write to a file opened for appending, by one process, so that a kill loses nothing but the line being
written; the next run takes such a torn line away. Where an item has several lines the last counts.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any

from .._core import InputError
from .._extras import extra

#: How an item ends, the best first. `done`: a function returned; `stopped`: by a limit, with the best so far; `failed`:
#: by the solver, or by an exception of a function; `refused`: the input is no problem; `timeout`: killed, as it did not
#: heed its time limit; `memory`: it wanted more than its limit; `crashed`: its process ended by a signal or without an
#: answer.
STATUSES = ("done", "converged", "stopped", "cancelled", "failed", "refused", "timeout", "memory", "crashed")

NAME = "results.jsonl"


class Journal:
    """The file of results, open and locked."""

    def __init__(self, folder: Path, fresh: bool) -> None:
        self.path = folder / NAME
        self._turn = threading.Lock()
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | getattr(os, "O_BINARY", 0)
        try:
            self._file = os.open(self.path, flags, 0o644)
        except OSError as e:
            raise InputError(f"{self.path}: it cannot be opened: {e.strerror}; check the folder") from e
        try:
            self._lock()
            if fresh:
                os.ftruncate(self._file, 0)
            self.records, whole = _parse(self.path, self.path.read_bytes())
            os.ftruncate(self._file, whole)
        except BaseException:
            os.close(self._file)
            raise

    def _lock(self) -> None:
        """Two batches in one folder would do everything twice."""
        try:
            import fcntl
        except ImportError:  # Windows; there a user has to see to it
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"{self.path}: another batch writes it; wait for that, or give another folder for results"
            ) from None
        except OSError:
            # Not every file system has locks.
            return

    def add(self, record: dict[str, Any]) -> None:
        """Appends a line, and sees that it is in the file; from any thread."""
        line = json.dumps(record, separators=(",", ":"), allow_nan=False).encode() + b"\n"
        with self._turn:
            end = os.fstat(self._file).st_size
            written = os.write(self._file, line)
            if written != len(line):
                # No room: a torn line must not be followed by a whole one.
                os.ftruncate(self._file, end)
                text = f"{self.path}: the line of {record['id']!r} has no room on the disk; make some, and run again"
                raise OSError(text)
            os.fsync(self._file)
            self.records.pop(record["id"], None)
            self.records[record["id"]] = record

    def close(self) -> None:
        os.close(self._file)

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, tb: TracebackType | None) -> None:
        self.close()


def _parse(path: Path, data: bytes) -> tuple[dict[str, dict[str, Any]], int]:
    """The records by id, the last of each, and the length of the whole lines."""
    whole = data.rfind(b"\n") + 1
    records: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(data[:whole].split(b"\n"), 1):
        if not line.strip():
            continue
        try:
            record = json.loads(line)
            records.pop(record["id"], None)
            records[record["id"]] = record
        except (ValueError, TypeError, KeyError) as e:
            raise InputError(f"{path}: line {number} is no result: {e}; correct it, or run with fresh=True") from e
    return records, whole


def read_results(out: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """The records in a folder of results, one for each item that has ended, in the order in which they ended; also
    while a batch is running.

    Raises InputError where the folder has no results, or a line is none.
    """
    path = Path(out) / NAME
    try:
        data = path.read_bytes()
    except OSError as e:
        raise InputError(f"{path}: it cannot be read: {e.strerror}; check the folder") from e
    return list(_parse(path, data)[0].values())


#: Columns of the Parquet file: numbers and texts; what else a record has is in `report`, as JSON.
COLUMNS = {
    "id": "string",
    "job": "string",
    "status": "string",
    "reason": "string",
    "attempts": "int64",
    "signal": "int64",
    "exit_code": "int64",
    "seconds": "float64",
    "peak_bytes": "int64",
    "out": "string",
    "node": "string",
    "digest": "string",
    "report": "string",
}


def require_parquet() -> Any:
    """pyarrow, or what to do to have it."""
    extra("pyarrow.parquet", "parquet", "results.parquet")
    return extra("pyarrow", "parquet", "results.parquet")


def write_parquet(records: Iterable[dict[str, Any]], path: str | os.PathLike[str]) -> None:
    """Writes records as a Parquet file, a row each, whole or not at all; `report` is JSON.

    Raises InputError without pyarrow (`pip install 'proxel[parquet]'`).
    """
    pa = require_parquet()
    rows = list(records)
    columns = {}
    for name, kind in COLUMNS.items():
        cells = [r.get(name) for r in rows]
        if name == "report":
            cells = [None if c is None else json.dumps(c) for c in cells]
        columns[name] = pa.array(cells, type=getattr(pa, kind)())
    target = Path(path)
    partial = target.with_name(target.name + ".partial")
    pa.parquet.write_table(pa.table(columns), partial)
    os.replace(partial, target)
