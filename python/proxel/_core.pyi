"""The compiled part: what the layer above calls. Nothing here is for users but the errors, Cancel and Progress."""

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

Points = NDArray[np.float64]
FaceArrays = tuple[NDArray[np.uint32], NDArray[np.uint32]]
Callback = Callable[[Progress], object]
Caller = tuple[Callback | None, Cancel | None, bool]
Mesh = tuple[Points, FaceArrays]
Targets = tuple[NDArray[np.uint32], Points]

class InputError(ValueError):
    """Input that describes no problem. The message names the item, by its 0-based index, and the remedy."""

class SolveError(RuntimeError):
    """A run that failed. The message says why; `info` is its report, where there is one."""

    info: Any

class BusyError(RuntimeError):
    """A call of an object that is at work in another call, which goes on. The message names the class and the remedy."""

class Cancel:
    """What ends a run from another thread: the best result so far is then what there is."""

    def __init__(self) -> None: ...
    def cancel(self) -> None:
        """Asks the run to end."""
    @property
    def cancelled(self) -> bool:
        """Whether it was asked to."""

class Progress:
    """Where a run stands: what a callback is given."""

    @property
    def frame(self) -> int: ...
    @property
    def iteration(self) -> int: ...
    @property
    def seconds(self) -> float: ...
    @property
    def energy(self) -> float: ...
    @property
    def inverted(self) -> int: ...

class Outcome:
    @property
    def report(self) -> str: ...
    @property
    def trace(self) -> dict[str, NDArray[Any]] | None: ...
    @property
    def arrays(self) -> dict[str, Any]: ...
    def save_preview(self, path: str | os.PathLike[str]) -> None: ...
    def adjoint(self, slope: Points) -> dict[str, Any]: ...

class Unwrapper:
    def __init__(self, points: Points, faces: FaceArrays, input: dict[str, Any], keywords: dict[str, Any]) -> None: ...
    def update_handles(self, held: Targets) -> None: ...
    def update_seams(self, seams: NDArray[np.uint32]) -> None: ...
    def step(self) -> tuple[int, float, int, int]: ...
    def solve(
        self, time_limit: float | None, callback: Callback | None, cancel: Cancel | None
    ) -> tuple[Points, NDArray[np.int32], Outcome]: ...
    def map(self) -> tuple[Points, NDArray[np.int32]]: ...

class Deformer:
    def __init__(self, points: Points, input: dict[str, Any], keywords: dict[str, Any]) -> None: ...
    def update_handles(self, targets: Targets) -> None: ...
    def move_group(
        self,
        name: str,
        rotation: tuple[list[float], float, list[float]] | None,
        translation: list[float] | None,
    ) -> None: ...
    def solve(
        self, time_limit: float | None, callback: Callback | None, cancel: Cancel | None
    ) -> tuple[Points, Outcome]: ...
    @property
    def positions(self) -> Points: ...

class Simulator:
    def __init__(self, scene: Any, keywords: dict[str, Any]) -> None: ...
    @property
    def frame_count(self) -> int: ...
    @property
    def frames(self) -> int: ...
    def start_record(self) -> str: ...
    def advance(
        self, time_limit: float | None, callback: Callback | None, cancel: Cancel | None
    ) -> tuple[str, bool, list[dict[str, Any]]]: ...
    def bodies(self) -> list[dict[str, Any]]: ...
    def outcome(self, status: str, reason: str) -> Outcome: ...

def settings(command: str, keywords: dict[str, Any]) -> str: ...
def unwrap(
    points: Points,
    faces: FaceArrays,
    input: dict[str, Any],
    keywords: dict[str, Any],
    callback: Callback | None,
    cancel: Cancel | None,
    traced: bool,
) -> tuple[Points, NDArray[np.int32], Outcome]: ...
def deform(
    points: Points,
    input: dict[str, Any],
    keywords: dict[str, Any],
    callback: Callback | None,
    cancel: Cancel | None,
    traced: bool,
) -> tuple[Points, Outcome]: ...
def problem(
    input: dict[str, Any],
    keywords: dict[str, Any],
    callback: Callback | None,
    cancel: Cancel | None,
    traced: bool,
) -> tuple[Points, Outcome]: ...
def planarize(
    mesh: Mesh, reference: Mesh | None, keywords: dict[str, Any], caller: Caller
) -> tuple[Points, Outcome]: ...
def wire(
    mesh: Mesh, reference: Mesh | None, keywords: dict[str, Any], caller: Caller
) -> tuple[Points, NDArray[np.int32] | None, Outcome]: ...
def shape(
    mesh: Mesh, reference: Mesh | None, recipe: Any, keywords: dict[str, Any], caller: Caller
) -> tuple[Points, Outcome]: ...
def geodesic(
    points: Points,
    faces: FaceArrays,
    sources: NDArray[np.uint32],
    keywords: dict[str, Any],
    callback: Callback | None,
    cancel: Cancel | None,
    traced: bool,
) -> tuple[NDArray[np.float64], Outcome]: ...
def restore(
    command: str,
    seen: NDArray[np.float64],
    known: dict[str, Any],
    keywords: dict[str, Any],
    callback: Callback | None,
    cancel: Cancel | None,
    traced: bool,
) -> tuple[NDArray[np.float64], Outcome]: ...
def wavefront(
    reference: NDArray[np.float64],
    captured: NDArray[np.float64],
    keywords: dict[str, Any],
    callback: Callback | None,
    cancel: Cancel | None,
    traced: bool,
) -> tuple[NDArray[np.float64], Outcome]: ...
