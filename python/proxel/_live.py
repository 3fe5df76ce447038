"""Problems that are built once and then solved again and again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import _arrays, _core
from ._bodies import body_input, padded
from ._core import Cancel
from ._info import Info, finish
from ._maps import map_input

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Unpack

    from ._settings import DeformSettings, UnwrapSettings
    from ._types import Callback


class Standing(NamedTuple):
    """How far a map is after a step."""

    iteration: int  # steps so far
    energy: float  # normalised, 1 at an isometry; infinite while triangles are flipped
    flips: int  # triangles that are flipped
    open: int  # charts that have not converged


class Unwrapper:
    """A map in the making: cut, started and analysed once, then moved by `step` and `solve`, and going on from
    where it is after its pins or seams were changed. Arguments are those of `unwrap`; `bijective` and `max_stretch`
    need `unwrap`.
    """

    def __init__(
        self,
        V: ArrayLike,
        F: Any,
        *,
        seams: ArrayLike | None = None,
        pins: ArrayLike | None = None,
        targets: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        metric: ArrayLike | None = None,
        start: Any = None,
        **settings: Unpack[UnwrapSettings],
    ) -> None:
        points, self._faces, more = map_input(V, F, seams, pins, targets, weights, metric, start)
        self._core = _core.Unwrapper(points, (self._faces.corners, self._faces.offsets), more, dict(settings))

    def step(self) -> Standing:
        """One iteration of every chart that has not converged."""
        return Standing(*self._core.step())

    def solve(
        self,
        *,
        time_limit: float | None = None,
        callback: Callback | None = None,
        cancel: Cancel | None = None,
    ) -> tuple[NDArray[np.float64], Info]:
        """Steps until all charts have converged, or the settings' `max_iters` steps were taken: the map, as
        `unwrap` returns it. `info.iterations` counts the steps of this call."""
        uv, corners, outcome = self._core.solve(time_limit, callback, cancel)
        return uv, finish(outcome, {"uv_faces": self._faces.restore(corners)})

    def update_handles(self, pins: ArrayLike, targets: ArrayLike) -> None:
        """Holds these vertices (p,) at these places (p, 2), and no others, from now on.

        Raises InputError for a vertex that does not exist or is held twice; pins are then as before.
        """
        if np.size(pins) == 0:
            self._core.update_handles((np.zeros(0, np.uint32), np.zeros((0, 2))))
            return
        self._core.update_handles(_arrays.targets(pins, targets, 2, ("pins", "targets")))

    def update_seams(self, seams: ArrayLike) -> None:
        """Cuts along these edges (s, 2), and no others, besides what has to be cut; corners go on from where they
        are."""
        self._core.update_seams(_arrays.elements(seams, [2], "seams", "seam"))

    def map(self) -> tuple[NDArray[np.float64], Any]:
        """The map as it is: `uv` (k, 2) and `uv_faces`."""
        uv, corners = self._core.map()
        return uv, self._faces.restore(corners)


class Deformer:
    """A body that is built once and then follows its handles: matrices are kept, and each `solve` begins where the
    last one ended. Arguments are those of `deform`.
    """

    def __init__(
        self,
        V: ArrayLike,
        T: Any,
        *,
        pins: Any = None,
        targets: ArrayLike | None = None,
        start: ArrayLike | None = None,
        regions: ArrayLike | None = None,
        springs: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
        forces: ArrayLike | None = None,
        pressure: float | None = None,
        obstacles: Sequence[tuple[ArrayLike, ArrayLike]] | None = None,
        **settings: Unpack[DeformSettings],
    ) -> None:
        points, self._dim, more = body_input(
            V, T, pins, targets, start, regions, springs, forces, pressure, obstacles, None
        )
        given: dict[str, Any] = dict(settings)
        if self._dim == 2:
            given.setdefault("planar", True)
        self._core = _core.Deformer(points, more, given)

    def update_handles(self, vertices: ArrayLike, targets: ArrayLike) -> None:
        """Sends pinned vertices (p,), and ends of springs, to new places (p, 3).

        Raises InputError for a vertex that is neither; nothing is moved then.
        """
        who, where = _arrays.index_list(vertices, "vertices"), padded(targets, self._dim, "targets")
        if len(who) != len(where):
            raise _core.InputError(f"targets: there are {len(where)} for {len(who)} vertices; give one for each")
        self._core.update_handles((who, where))

    def move_group(
        self,
        name: str,
        *,
        axis: Sequence[float] = (0.0, 0.0, 1.0),
        angle: float = 0.0,
        center: Sequence[float] = (0.0, 0.0, 0.0),
        translation: Sequence[float] | None = None,
    ) -> None:
        """Turns a group of pins, as it was when the body was built, by `angle` degrees around `axis` through
        `center`, and then moves it. Pins that were given as indices are the group "pins"."""
        turn = None if angle == 0.0 else ([float(a) for a in axis], float(angle), [float(c) for c in center])
        self._core.move_group(name, turn, None if translation is None else [float(t) for t in translation])

    def solve(
        self,
        *,
        time_limit: float | None = None,
        callback: Callback | None = None,
        cancel: Cancel | None = None,
    ) -> tuple[NDArray[np.float64], Info]:
        """Goes on towards the minimum for the targets as they are, for no longer than `time_limit` seconds:
        positions of the shape of V, and the info of this step."""
        X, outcome = self._core.solve(time_limit, callback, cancel)
        return np.ascontiguousarray(X[:, : self._dim]), finish(outcome, dim=self._dim)

    @property
    def positions(self) -> NDArray[np.float64]:
        """The pose that the last `solve` ended at."""
        return np.ascontiguousarray(self._core.positions[:, : self._dim])
