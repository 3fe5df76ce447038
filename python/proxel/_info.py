"""What is known of a run: its settings before, and its report when it is over."""

from __future__ import annotations

import json
import keyword
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _core
from ._core import InputError, Outcome, SolveError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class Gradients:
    """The derivatives of a function L of a result in what the run was given, under the names of its arguments.

    Of `deform`: `V` (n, 3) with targets and forces held; `targets` (p, 3), a row for each of `pins` (p,);
    `spring_targets` (s, 3); `forces` (n, 3), whether there is one or not; `young`, `poisson` (None where moduli were
    given by `mu`), `mu` and `lambda_` of the material; `materials`, a dict of the same for each region. Of `unwrap`: `V` (n, 3) and `targets` (p, 2).

    `distance` is how far the result is from the minimum, to first order, in units of length.
    """

    V: NDArray[np.float64]
    targets: NDArray[np.float64]
    pins: NDArray[np.int32]
    spring_targets: NDArray[np.float64]
    forces: NDArray[np.float64]
    young: float | None
    poisson: float | None
    mu: float
    lambda_: float
    materials: dict[int, dict[str, float | None]]
    distance: float

    def __init__(self, found: dict[str, Any], dim: int) -> None:
        for name, value in found.items():
            if isinstance(value, np.ndarray) and value.ndim == 2:
                value = np.ascontiguousarray(value[:, :dim])
            setattr(self, name, value)

    def __repr__(self) -> str:
        return f"<Gradients: {', '.join(vars(self))}>"


class Trace:
    """The history of a run: an array for each column of the trace of the command line, a row for each iteration
    from 0, the start; `inf` where a number is not defined.

    Every run has `iteration`, `seconds`, `energy`, `gradient_norm`, `position_error`, `primal_residual`,
    `dual_residual`, `merit`, `inner`, `refactorised`, `accepted` and `inverted`; maps have `flips` and `energy_z`,
    images `part`, `duality_gap` and `psnr` too.
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
    part: NDArray[np.float64]
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

    def __init__(self, outcome: Outcome, arrays: dict[str, Any] | None = None, dim: int = 3) -> None:
        self._outcome: Outcome | None = outcome
        self._dim = dim
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

    def adjoint(self, dL: ArrayLike) -> Gradients:
        """The gradients of a function L of the result of `deform` or `unwrap`, or of a `solve` of a `Deformer` or an
        `Unwrapper`, in what that was given.

        `dL` is dL/dX (n, 3) of positions, or dL/duv (k, 2) of a map: of the shape of what came with this info. By the
        implicit function theorem, with one factor of the true Hessian: nothing is solved anew.

        A map without pins is determined up to a motion of the plane: its gradients are those of the map that is
        always moved and turned, chart by chart, such that it lies nearest to this one. For an L that does not see
        such motions they are its gradients.

        Raises InputError where the run has not converged, and for what has no gradient: packed maps, obstacles,
        energies of one's own, surfaces that a lattice carries, results that are no minimum. The message says what to do.
        """
        if self._outcome is None:
            raise InputError("gradients need what stayed in the process that has solved; ask for them there")
        columns = 2 if self.command == "unwrap" else self._dim
        slope = _arrays.table(dL, columns, "dL")
        if self.command == "deform" and columns == 2:
            slope = np.concatenate([slope, np.zeros((len(slope), 1))], axis=1)
        found = self._outcome.adjoint(slope)
        if self.command == "deform":
            found["pins"] = self._arrays["pins"]
            return Gradients(found, columns)
        return Gradients(found, 3)


def finish(outcome: Outcome, arrays: dict[str, Any] | None = None, dim: int = 3) -> Info:
    """The info of a run, unless it has failed; of positions with `dim` coordinates."""
    info = Info(outcome, arrays, dim)
    if info.status == "failed":
        error = SolveError(info.reason)
        error.info = info
        raise error
    return info


def settings(command: str, **settings: Any) -> dict[str, Any]:
    """All settings of a command, with those given in the place of defaults: what `--show-settings` prints.

    `command` is "unwrap", "deform", "planarize", "wire", "shape", "problem", "geodesic", "deblur", "denoise", "inpaint"
    or "wavefront". Raises InputError for a name that no setting has, with those that there are, and for a value of the
    wrong kind.
    """
    out: dict[str, Any] = json.loads(_core.settings(command, settings))
    return out
