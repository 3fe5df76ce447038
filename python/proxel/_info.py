"""What is known of a run that is over."""

from __future__ import annotations

import json
import keyword
import os
from typing import TYPE_CHECKING, Any

from ._core import InputError, Outcome, SolveError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Trace:
    """The history of a run: an array for each column of the trace of the command line, a row for each iteration
    from 0, the start; `inf` where a number is not defined.

    Every run has `iteration`, `seconds`, `energy`, `gradient_norm`, `position_error`, `primal_residual`,
    `dual_residual`, `merit`, `inner`, `refactorised`, `accepted` and `inverted`; maps have `flips` and `energy_z`,
    images `duality_gap` and `psnr` too.
    """

    iteration: NDArray[np.int64]
    seconds: NDArray[np.float64]
    energy: NDArray[np.float64]
    gradient_norm: NDArray[np.float64]
    position_error: NDArray[np.float64]
    primal_residual: NDArray[np.float64]
    dual_residual: NDArray[np.float64]
    merit: NDArray[np.float64]
    inner: NDArray[np.int64]
    refactorised: NDArray[np.bool_]
    accepted: NDArray[np.bool_]
    inverted: NDArray[np.int64]
    flips: NDArray[np.int64]
    energy_z: NDArray[np.float64]
    duality_gap: NDArray[np.float64]
    psnr: NDArray[np.float64]

    def __init__(self, columns: dict[str, NDArray[Any]]) -> None:
        self.__dict__.update(columns)

    @property
    def columns(self) -> list[str]:
        """The names of the arrays."""
        return list(self.__dict__)

    def __len__(self) -> int:
        return len(self.iteration)

    def __repr__(self) -> str:
        return f"<Trace of {len(self)} rows: {', '.join(self.columns)}>"


class Info:
    """The report of a run. Its attributes have the names of the keys of the command line's report, and None where
    one does not apply: `status` ("converged", "stopped", "cancelled"), `reason`, `iterations`, `energy`,
    `gradient_ratio`, `inverted`, `warnings`, `repaired`, `seconds`, `settings`, ...; of maps `flips`, `overlaps`,
    `charts`, ... Arrays that a function returns beside its result are attributes too. `trace` is the history where
    it was asked for by `trace=True`.
    """

    version: str
    command: str
    settings: dict[str, Any]
    method: str
    status: str
    reason: str
    iterations: int
    inner_iterations: int
    refactorisations: int
    energy: float | None
    gradient_norm: float | None
    gradient_ratio: float | None
    inverted: int | None
    min_stretch: float | None
    max_stretch: float | None
    position_error: float | None
    primal_residual: float | None
    dual_residual: float | None
    accepted: int
    rejected: int
    warnings: list[str]
    repaired: list[str]
    seconds: dict[str, float]
    peak_bytes: int | None
    factor_bytes: int | None
    threads: int
    trace: Trace | None

    def __init__(self, outcome: Outcome, arrays: dict[str, Any] | None = None) -> None:
        self._outcome: Outcome | None = outcome
        self._report: dict[str, Any] = json.loads(outcome.report)
        self._arrays = {**outcome.arrays, **(arrays or {})}
        self.trace = None if outcome.trace is None else Trace(outcome.trace)

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("_"):
            # Python keeps the word `lambda`.
            if name.endswith("_") and keyword.iskeyword(name[:-1]):
                name = name[:-1]
            for known in (self._report, self._arrays):
                if name in known:
                    return known[name]
        # An object that is being unpickled has no report yet.
        command = self.__dict__.get("_report", {}).get("command")
        raise AttributeError(f"a report of {command} has no `{name}`")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._report, *self._arrays})

    def __repr__(self) -> str:
        return f"<Info: {self.command} {self.status} after {self.iterations} iterations: {self.reason}>"

    def __getstate__(self) -> dict[str, Any]:
        # The picture is drawn from what only this process has.
        return {**self.__dict__, "_outcome": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    def to_dict(self) -> dict[str, Any]:
        """The report as the command line writes it."""
        return dict(self._report)

    def to_json(self) -> str:
        """The same as text."""
        return json.dumps(self._report, indent=2)

    def save_preview(self, path: str | os.PathLike[str]) -> None:
        """Writes the picture that the command line's `--preview` draws, as PNG.

        Raises InputError where the name does not end in .png, nothing can be written there, or there is no picture.
        """
        if self._outcome is None:
            raise InputError("the picture stayed in the process that has solved; draw it there")
        self._outcome.save_preview(path)


def finish(outcome: Outcome, arrays: dict[str, Any] | None = None) -> Info:
    """The info of a run, unless it has failed."""
    info = Info(outcome, arrays)
    if info.status == "failed":
        error = SolveError(info.reason)
        error.info = info
        raise error
    return info
