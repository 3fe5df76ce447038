"""Maps of surfaces to the plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _core
from ._core import Cancel, InputError
from ._info import Info, finish

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Unpack

    from ._settings import UnwrapSettings
    from ._types import Callback


def map_input(
    V: ArrayLike,
    F: Any,
    seams: ArrayLike | None,
    pins: ArrayLike | None,
    targets: ArrayLike | None,
    weights: ArrayLike | None,
    metric: ArrayLike | None,
    start: Any,
) -> tuple[Any, _arrays.Faces, dict[str, Any]]:
    points, faces = _arrays.points(V), _arrays.faces(F)
    m = len(faces.offsets) - 1
    if (pins is None) != (targets is None):
        raise InputError("pins and targets belong together; give both")
    held = None if pins is None or targets is None else _arrays.targets(pins, targets, 2, ("pins", "targets"))
    begin = None
    if start is not None:
        uv, corners = start if isinstance(start, tuple) else (start, faces.corners)
        flat = np.concatenate([np.ravel(c) for c in corners]) if isinstance(corners, list) else np.ravel(corners)
        begin = (_arrays.table(uv, 2, "start"), np.ascontiguousarray(flat, dtype=np.int64))
    return (
        points,
        faces,
        {
            "seams": None if seams is None else _arrays.elements(seams, [2], "seams", "seam"),
            "pins": held,
            "weights": None if weights is None else _arrays.vector(weights, m, "weights"),
            "metric": None if metric is None else _arrays.table(metric, 6, "metric"),
            "start": begin,
        },
    )


def unwrap(
    V: ArrayLike,
    F: Any,
    *,
    seams: ArrayLike | None = None,
    pins: ArrayLike | None = None,
    targets: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    metric: ArrayLike | None = None,
    start: Any = None,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[UnwrapSettings],
) -> tuple[NDArray[np.float64], Info]:
    """Maps a surface into the plane with least distortion, without flips; what is closed is cut open along few seams.

    `V` is (n, 3), or (n, 2) for a surface in the plane; `F` are triangles (m, 3), quads (m, 4) or a list of faces
    of any sizes. `seams` (s, 2) are edges to cut along besides; `pins` (p,) are vertices that `targets` (p, 2)
    hold, in units of V; `weights` (m,) say how much the distortion of a face counts; `metric` (m, 6) are target
    metrics xx, xy, xz, yy, yz, zz; `start` is the map to begin with: (k, 2) where k = n, or a pair (uv, uv_faces).

    Returns `uv` (k, 2) and the info, whose `uv_faces` has the shape of F and says which row of `uv` each corner has
    (-1 where a face is not mapped). Where nothing was cut, k = n and `uv_faces` equals F; a vertex of no face then
    has NaN. Packed maps fill the unit square (`pack=False` keeps units of V). `info.flips`, `info.overlaps` and the
    distortions are measured on `uv` by exact predicates.

    `callback` is called with a `Progress` after every iteration of a large chart; what is true ends the run, as
    does `cancel`, and `time_limit` in seconds. With `trace=True` the info has the history. Raises InputError for
    input that describes no map, SolveError where a run failed, KeyboardInterrupt on Ctrl-C.

    Brown and Narain 2021 (WRAPD), Rabinovich et al. 2017 (SLIM), Shtengel et al. 2017 (CM), and others by `method`.
    """
    points, faces, more = map_input(V, F, seams, pins, targets, weights, metric, start)
    uv, corners, outcome = _core.unwrap(
        points, (faces.corners, faces.offsets), more, dict(settings), callback, cancel, trace
    )
    return uv, finish(outcome, {"uv_faces": faces.restore(corners)})
