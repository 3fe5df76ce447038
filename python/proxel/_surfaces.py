"""Surfaces: planar faces, edges of one length, any constraints, distances."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _core
from ._core import Cancel
from ._info import Info, finish

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Unpack

    from ._settings import GeodesicSettings, ShapeSettings, WireSettings
    from ._types import Callback


def _mesh(V: ArrayLike, F: Any, what: tuple[str, str]) -> tuple[tuple[Any, Any], _arrays.Faces]:
    faces = _arrays.faces(F, what[1])
    return (_arrays.points(V, what[0]), (faces.corners, faces.offsets)), faces


def _reference(reference: tuple[ArrayLike, Any] | None) -> tuple[Any, Any] | None:
    if reference is None:
        return None
    return _mesh(*reference, ("reference", "faces of the reference"))[0]


def planarize(
    V: ArrayLike,
    F: Any,
    *,
    reference: tuple[ArrayLike, Any] | None = None,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[ShapeSettings],
) -> tuple[NDArray[np.float64], Info]:
    """Moves vertices until every face is planar, near to a reference surface (vertices and faces; the mesh as it
    comes).

    `V` is (n, 3), `F` quads (m, 4) or a list of faces of any sizes. Returns positions (n, 3) and the info:
    `info.planarity_max["after"]` over the mean edge, `info.planarity` (m,) of each face, `info.distance` (n,) from the
    reference. For `callback`, `cancel`, `trace` and errors see `unwrap`.

    Zhang, Peng, Ouyang and Deng 2019, section 4.2.
    """
    mesh, _ = _mesh(V, F, ("V", "F"))
    X, outcome = _core.planarize(mesh, _reference(reference), dict(settings), (callback, cancel, trace))
    return X, finish(outcome)


def wire(
    V: ArrayLike,
    F: Any,
    *,
    reference: tuple[ArrayLike, Any] | None = None,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[WireSettings],
) -> tuple[NDArray[np.float64], Info]:
    """Moves vertices until all edges have one length (`edge_length`; the mean of the mesh) and the angles of faces
    are within `min_angle` and `max_angle`, in degrees, near to a reference surface.

    Returns positions (n, 3) and the info: `info.edge_error_max["after"]`, `info.angle_error_max["after"]`, and of
    each face `info.edge_error`, `info.angle_error`. With `subdivide=k` faces are first made quads, k times;
    `info.faces` (m', 4) are those that the positions are of. For `callback`, `cancel`, `trace` and errors see
    `unwrap`.

    Garg et al. 2014; Zhang, Peng, Ouyang and Deng 2019, section 4.2.
    """
    mesh, faces = _mesh(V, F, ("V", "F"))
    X, quads, outcome = _core.wire(mesh, _reference(reference), dict(settings), (callback, cancel, trace))
    corners = faces.restore(faces.corners.astype(np.int32)) if quads is None else quads.reshape(-1, 4)
    return X, finish(outcome, {"faces": corners})


def shape(
    V: ArrayLike,
    F: Any,
    recipe: str | os.PathLike[str] | Mapping[str, Any],
    *,
    reference: tuple[ArrayLike, Any] | None = None,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[ShapeSettings],
) -> tuple[NDArray[np.float64], Info]:
    """Moves vertices until the constraints of a recipe hold, hard ones exactly, soft ones by their weights.

    `recipe` is the path of a .toml or .json file, or what it would hold as a dict: `{"constraint": [{"kind":
    "planar"}, {"kind": "near", "weight": 1}]}`; the mesh is V and F whatever it names. `proxel schema recipe`
    prints all keys. Returns positions (n, 3) and the info, whose `constraints` say how far each was off before and
    after. For `callback`, `cancel`, `trace` and errors see `unwrap`.
    """
    mesh, _ = _mesh(V, F, ("V", "F"))
    what = os.fspath(recipe) if isinstance(recipe, (str, os.PathLike)) else recipe
    X, outcome = _core.shape(mesh, _reference(reference), what, dict(settings), (callback, cancel, trace))
    return X, finish(outcome)


def geodesic(
    V: ArrayLike,
    F: Any,
    sources: ArrayLike,
    *,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[GeodesicSettings],
) -> tuple[NDArray[np.float64], Info]:
    """Distances along a surface from the nearest of some source vertices, by the heat method.

    Returns distances (n,) in units of V, `inf` where no path leads, and the info. The system of `method="poisson"`,
    which `auto` is, has no iterations to call back after. For `callback`, `cancel`, `trace` and errors see
    `unwrap`.

    Crane, Weischedel and Wardetzky 2013; Tao, Zhang, Deng and Peng 2019 (`admm`, `aa-admm`).
    """
    points, faces = _arrays.points(V), _arrays.faces(F)
    who = _arrays.index_list(sources, "sources")
    distance, outcome = _core.geodesic(
        points, (faces.corners, faces.offsets), who, dict(settings), callback, cancel, trace
    )
    return distance, finish(outcome)
