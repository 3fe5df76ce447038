"""Bodies in motion, frame by frame."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from . import _core
from ._core import Cancel, InputError, SolveError
from ._info import Info

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ._types import Callback


class Frame:
    """A frame: numbers, and each body as it stands.

    Attributes are those of the frames of a report: `frame`, `time` (s), `kinetic`, `elastic`, `potential` (J),
    `momentum`, `angular_momentum`, `iterations`, `max_penetration`, `max_strain_violation`, `contacts`, `inverted`,
    `status` ("start", "converged", "stopped", ...), `reason`, `seconds`, ...

    `positions[name]` (n, 3) and `velocities[name]` (n, 3) are those of a body in the order of its mesh;
    `fields[name]` has what is known of its vertices (displacement, forces of contact and reaction, ..),
    `cell_fields[name]` of its elements.
    """

    def __init__(self, record: dict[str, Any], bodies: list[dict[str, Any]], done: bool) -> None:
        self._record = record
        #: Whether the frame was done; one that was cancelled, or cut short by a time limit, is as the frame before.
        self.done = done
        self.positions: dict[str, NDArray[np.float64]] = {b["name"]: b["positions"] for b in bodies}
        self.fields: dict[str, dict[str, NDArray[np.float64]]] = {b["name"]: b["point"] for b in bodies}
        self.cell_fields: dict[str, dict[str, NDArray[np.float64]]] = {b["name"]: b["cell"] for b in bodies}

    @property
    def velocities(self) -> dict[str, NDArray[np.float64]]:
        """Of each body, (n, 3), m/s."""
        return {name: fields["velocity"] for name, fields in self.fields.items()}

    def __getattr__(self, name: str) -> Any:
        record = self.__dict__.get("_record", {})
        if name in record:
            return record[name]
        raise AttributeError(f"a frame has no `{name}`")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._record})

    def to_dict(self) -> dict[str, Any]:
        """The numbers of the frame."""
        return dict(self._record)

    def __repr__(self) -> str:
        return f"<Frame {self._record['frame']} at {self._record['time']:.4g} s: {self._record['status']}>"


_WORSE = ("start", "converged", "stopped", "cancelled", "failed")


class Simulator:
    """A scene, advanced frame by frame.

    `scene` is the path of a .toml or .json file, or what it would hold as a dict; `proxel schema scene` prints all
    keys. `frames`, `method`, `tol`, `max_iters` stand in the place of the scene's, `threads` beside them. Raises
    InputError for what cannot be simulated, by name.
    """

    def __init__(self, scene: str | os.PathLike[str] | Mapping[str, Any], **settings: Any) -> None:
        what = os.fspath(scene) if isinstance(scene, (str, os.PathLike)) else scene
        self._core = _core.Simulator(what, settings)
        self._status = ("converged", "no frame was done yet")
        self._frame = Frame(json.loads(self._core.start_record()), self._core.bodies(), True)

    @property
    def frame(self) -> Frame:
        """The last frame that was done; frame 0 is the start."""
        return self._frame

    @property
    def frames(self) -> int:
        """Frames after the start that the scene asks for."""
        return self._core.frames

    def step(
        self,
        *,
        time_limit: float | None = None,
        callback: Callback | None = None,
        cancel: Cancel | None = None,
    ) -> Frame:
        """The next frame. One that is cancelled, or that `time_limit` seconds cut short, changes nothing: `done` is
        false, and the simulation can go on from where it was. Raises SolveError where the frame failed; the state
        is then as before.
        """
        text, done, bodies = self._core.advance(time_limit, callback, cancel)
        record = json.loads(text)
        status = record["status"]
        if not done or _WORSE.index(status) > _WORSE.index(self._status[0]):
            self._status = (status, f"frame {record['frame']}: {record['reason']}")
        elif self._status[0] == "converged":
            self._status = (status, f"all steps of {record['frame']} frames converged")
        if status == "failed":
            error = SolveError(f"frame {record['frame']}: {record['reason']}")
            error.info = self.info
            raise error
        frame = Frame(record, bodies, done)
        if done:
            self._frame = frame
        return frame

    @property
    def info(self) -> Info:
        """The report of the frames so far: a run is as good as its worst frame."""
        return Info(self._core.outcome(*self._status))


class Frames(Iterator[Frame]):
    """The frames of a scene, the start first. `simulator` is what makes them, `info` the report so far."""

    def __init__(
        self,
        simulator: Simulator,
        time_limit: float | None,
        callback: Callback | None,
        cancel: Cancel | None,
    ) -> None:
        self.simulator = simulator
        self._end = None if time_limit is None else time.monotonic() + time_limit
        self._heard = (callback, cancel)
        self._begun = False

    @property
    def info(self) -> Info:
        """The report so far."""
        return self.simulator.info

    def __iter__(self) -> Frames:
        return self

    def __next__(self) -> Frame:
        if not self._begun:
            self._begun = True
            return self.simulator.frame
        if self.simulator.frame.frame >= self.simulator.frames:
            raise StopIteration
        left = None if self._end is None else max(0.0, self._end - time.monotonic())
        callback, cancel = self._heard
        frame = self.simulator.step(time_limit=left, callback=callback, cancel=cancel)
        if not frame.done:
            raise StopIteration
        return frame


def simulate(
    scene: str | os.PathLike[str] | Mapping[str, Any],
    *,
    time_limit: float | None = None,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    **settings: Any,
) -> Frames:
    """The frames of a scene as they are made, the start first: `for frame in proxel.simulate("scene.toml"): ...`.

    For the scene and `settings` see `Simulator`, for what frames have `Frame`. `time_limit` is that of the whole run in
    seconds; when it is over, or `cancel` or a true result of `callback` ended the run, there are no more frames, and
    `frames.info.status` says so. Raises SolveError where a frame failed.

    Implicit Euler or BDF2, each step a minimum under hard contact and strain limits: docs/simulate.md.
    """
    if time_limit is not None and not time_limit >= 0:
        raise InputError(f"time_limit is {time_limit}; give seconds from 0")
    return Frames(Simulator(scene, **settings), time_limit, callback, cancel)
