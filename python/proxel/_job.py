"""Runs in the background."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from ._core import Cancel, Progress

T = TypeVar("T")


class Job(Generic[T]):
    """A run in a thread of its own, which does not hold Python's lock while it solves.

    `Job(proxel.unwrap, V, F, method="auto")` begins at once. Any function and method of the package that takes
    `callback` and `cancel` can be run so; a `callback` of your own is called in that thread.

        job = proxel.Job(proxel.unwrap, V, F)
        while not job.wait(0.1):
            print(job.progress)
        uv, info = job.result()
    """

    def __init__(self, function: Callable[..., T], /, *args: Any, **keywords: Any) -> None:
        self._cancel: Cancel = keywords.pop("cancel", None) or Cancel()
        self._callback = keywords.pop("callback", None)
        self._progress: Progress | None = None
        self._result: T | None = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, args=(function, args, keywords), daemon=True)
        self._thread.start()

    def _run(self, function: Callable[..., T], args: tuple[Any, ...], keywords: dict[str, Any]) -> None:
        try:
            self._result = function(*args, callback=self._heard, cancel=self._cancel, **keywords)
        except BaseException as e:  # result() raises it where it is asked for
            self._error = e

    def _heard(self, progress: Progress) -> object:
        self._progress = progress
        return self._callback(progress) if self._callback is not None else None

    @property
    def progress(self) -> Progress | None:
        """Where the run stands; None before its first iteration."""
        return self._progress

    @property
    def done(self) -> bool:
        """Whether it is over."""
        return not self._thread.is_alive()

    def cancel(self) -> None:
        """Asks it to end: its result is then the best so far, with the status "cancelled"."""
        self._cancel.cancel()

    def wait(self, timeout: float | None = None) -> bool:
        """Waits for its end, for no longer than `timeout` seconds; whether it is over."""
        self._thread.join(timeout)
        return self.done

    def result(self, timeout: float | None = None) -> T:
        """What the function returned, or raises what it raised. TimeoutError where it is not over after `timeout`
        seconds."""
        if not self.wait(timeout):
            raise TimeoutError(f"the job is not over after {timeout} seconds; wait longer, or cancel it")
        if self._error is not None:
            raise self._error
        return self._result  # type: ignore[return-value]
