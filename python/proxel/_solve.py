"""One call for each job."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _core
from ._core import Cancel, InputError, Progress
from ._info import Info, finish

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Unpack

    from ._settings import (
        DeformSettings,
        GeodesicSettings,
        RestoreSettings,
        ShapeSettings,
        UnwrapSettings,
        WavefrontSettings,
        WireSettings,
    )

    Callback = Callable[[Progress], object]
    Energy = Callable[[NDArray[np.float64]], tuple[Any, Any]]


def settings(command: str, **settings: Any) -> dict[str, Any]:
    """All settings of a command, with those given in the place of defaults: what `--show-settings` prints.

    `command` is "unwrap", "deform", "planarize", "wire", "shape", "problem", "geodesic", "deblur", "denoise", "inpaint"
    or "wavefront". Raises InputError for a name that no setting has, with those that there are, and for a value of the
    wrong kind.
    """
    out: dict[str, Any] = json.loads(_core.settings(command, settings))
    return out


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


def body_input(
    V: ArrayLike,
    T: Any,
    pins: Any,
    targets: ArrayLike | None,
    start: ArrayLike | None,
    regions: ArrayLike | None,
    springs: tuple[ArrayLike, ArrayLike, ArrayLike] | None,
    forces: ArrayLike | None,
    pressure: float | None,
    obstacles: Any,
    reference: ArrayLike | None,
    energy: Energy | None = None,
) -> tuple[NDArray[np.float64], int, dict[str, Any]]:
    """Points, how many coordinates they came with, and the rest of a body."""
    points = _arrays.points(V)
    dim = int(np.shape(V)[1])
    more: dict[str, Any] = dict.fromkeys(("tets", "faces", "edges", "pins", "groups", "springs", "obstacles"))
    columns = np.shape(T)[1] if isinstance(T, np.ndarray) and T.ndim == 2 else None
    if columns is None:
        sizes = {np.size(row) for row in T}
        columns = sizes.pop() if len(sizes) == 1 else 3
    if columns == 4:
        more["tets"] = _arrays.elements(T, [4], "T", "tetrahedron")
    elif columns == 2:
        more["edges"] = _arrays.elements(T, [2], "T", "edge")
    elif columns == 3:
        faces = _arrays.faces(T, "T")
        more["faces"] = (faces.corners, faces.offsets)
    else:
        raise InputError(f"T: it has rows of {columns}; give tetrahedra (m, 4), triangles (m, 3) or edges (m, 2)")
    if isinstance(pins, (str, os.PathLike, Mapping)):
        if targets is not None:
            raise InputError("pins by groups say themselves where they go; leave targets out")
        more["groups"] = os.fspath(pins) if isinstance(pins, (str, os.PathLike)) else pins
    elif pins is not None:
        who = _arrays.index_list(pins, "pins")
        if who.size and int(who.max()) >= len(points):
            raise InputError(f"pins: vertex {int(who.max())} does not exist; there are {len(points)} (0-based)")
        begin = points if start is None else _arrays.points(start, "start")
        where = begin[who] if targets is None else _padded(targets, dim, "targets")
        if len(who) != len(where):
            raise InputError(f"targets: there are {len(where)} for {len(who)} pins; give one for each")
        more["pins"] = (who, np.ascontiguousarray(where))
    elif targets is not None:
        raise InputError("targets are those of pins; give pins")
    if springs is not None:
        who = _arrays.index_list(springs[0], "springs")
        where = _padded(springs[1], dim, "springs")
        if len(who) != len(where):
            raise InputError(f"springs: there are {len(where)} targets for {len(who)} vertices; give one for each")
        more["springs"] = (who, where, _arrays.vector(springs[2], len(who), "springs"))
    if obstacles is not None:
        planes = [np.concatenate([_arrays.real(v, "obstacles") for v in plane]) for plane in obstacles]
        more["obstacles"] = _arrays.table(np.array(planes), 6, "obstacles") if planes else None
    more["start"] = None if start is None else _padded(start, dim, "start")
    numbers = None if regions is None else _arrays.real(regions, "regions")
    more["regions"] = None if numbers is None else np.ascontiguousarray(numbers, dtype=np.int32)
    more["forces"] = None if forces is None else _padded(forces, dim, "forces")
    more["pressure"] = None if pressure is None else float(pressure)
    more["reference"] = None if reference is None else _padded(reference, dim, "reference")
    more["energy"] = None if energy is None else (_checked(energy), bool(getattr(energy, "barrier", False)))
    return points, dim, more


def _checked(energy: Energy) -> Energy:
    """With results as the compiled part takes them."""

    def checked(F: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        answer = energy(F)
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise InputError("energy: it returned no pair; return psi (m,) and dpsi/dF (m, 3, 3)")
        psi, P = _arrays.real(answer[0], "energy: psi"), _arrays.real(answer[1], "energy: dpsi/dF")
        if psi.shape != F.shape[:1] or P.shape != F.shape:
            raise InputError(f"energy: psi is {psi.shape} and dpsi/dF {P.shape}; return {F.shape[:1]} and {F.shape}")
        return psi, P

    return checked


def _padded(array: ArrayLike, dim: int, what: str) -> NDArray[np.float64]:
    """(p, 3) of as many coordinates as V has."""
    out = _arrays.table(array, dim, what)
    return out if dim == 3 else np.concatenate([out, np.zeros((len(out), 1))], axis=1)


def deform(
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
    reference: ArrayLike | None = None,
    energy: Energy | None = None,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[DeformSettings],
) -> tuple[NDArray[np.float64], Info]:
    """Finds positions of least elastic energy.

    `V` is the rest shape (n, 3); `T` are tetrahedra (m, 4), triangles (m, 3) or edges (m, 2). Triangles that bound
    a body are its skin, which a lattice of tetrahedra carries; otherwise they are a thin sheet (`surface="shell"`
    or "embed" says which). With `V` (n, 2) all is in the plane.

    `pins` (p,) are vertices that `targets` (p, 3) hold, or their start where no targets are given; or the path of a
    pins file, or its groups as a dict: `{"groups": {"hand": {"indices": [0, 1], "translate": [0, 1, 0]}}}`.
    `springs` are vertices, targets and stiffnesses (force over length); `forces` (n, 3) act on vertices, `pressure`
    on all faces along their normals; `obstacles` are pairs of a point and a normal, planes that vertices stay on
    the side of; `regions` (m,) choose from `materials={1: {"young": 1e5}}`. `material` is a name or a dict;
    `young`, `poisson`, `mu` and `lambda_` may stand beside it. `start` (n, 3) is where the iteration begins,
    `reference` what the position error is measured against.

    `energy` is one of your own, of tetrahedra, in the place of the material's: a function of deformation gradients
    F (m, 3, 3), in the order of T, that returns densities psi (m,) over rest volume and dpsi/dF (m, 3, 3). It needs
    `method="lbfgs"` or "bcqn"; the material's stiffness at rest preconditions. An attribute `barrier = True` says
    that psi is infinite where det F <= 0.

    Returns positions of the shape of V, pinned vertices bit for bit, and the info; `info.reaction` (n, 3) is the
    force that the body exerts on what holds it. For `callback`, `cancel`, `trace` and errors see `unwrap`.

    Brown and Narain 2021 (WRAPD), and others by `method`; `auto` goes on by Newton's method.
    """
    points, dim, more = body_input(
        V, T, pins, targets, start, regions, springs, forces, pressure, obstacles, reference, energy
    )
    given: dict[str, Any] = dict(settings)
    if dim == 2:
        given.setdefault("planar", True)
    X, outcome = _core.deform(points, more, given, callback, cancel, trace)
    return np.ascontiguousarray(X[:, :dim]), finish(outcome, dim=dim)


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


def _restored(
    command: str,
    image: ArrayLike,
    psf: Any,
    center: tuple[int, int] | None,
    mask: ArrayLike | None,
    truth: ArrayLike | None,
    settings: Mapping[str, Any],
    callback: Callback | None,
    cancel: Cancel | None,
    trace: bool,
) -> tuple[NDArray[np.float64], Info]:
    seen, channels = _arrays.image(image, "image")
    blur: Any = psf
    if psf is not None and not isinstance(psf, str):
        weights = _arrays.real(psf, "psf")
        if weights.ndim != 2:
            raise InputError(f"psf: its shape is {weights.shape}; give (h, w), or a name such as gaussian:1.6")
        blur = (weights, center)
    elif center is not None:
        raise InputError("psf_center is that of an array; leave it out for a psf by name")
    known = None
    if mask is not None:
        known = np.ascontiguousarray(np.asarray(mask) != 0, dtype=np.float64)
        if known.ndim != 2:
            raise InputError(f"mask: its shape is {known.shape}; give (h, w)")
    more = {
        "psf": blur,
        "mask": known,
        "truth": None if truth is None else _arrays.image(truth, "truth")[0],
        "has_channels": channels,
    }
    out, outcome = _core.restore(command, seen, more, dict(settings), callback, cancel, trace)
    return out, finish(outcome)


def deblur(
    image: ArrayLike,
    psf: Any,
    *,
    psf_center: tuple[int, int] | None = None,
    mask: ArrayLike | None = None,
    truth: ArrayLike | None = None,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[RestoreSettings],
) -> tuple[NDArray[np.float64], Info]:
    """Sharpens a blurred, noisy image by least total variation.

    `image` is (h, w) or (h, w, channels), linear, of any scale (pictures expect 0 to 1); `psf` are weights (h, w)
    around `psf_center` (row and column; the middle), or "gaussian:S", "motion:LENGTH,ANGLE", "disk:R" in pixels;
    `mask` (h, w) is not 0 where a pixel was measured; `truth` is only measured against (`info.psnr`). `lambda_`
    weighs fidelity; without it one is chosen by an estimate of the risk (`info.lambda_`).

    Returns an image of the same shape and the info; `info.relative_gap` bounds how far it is from the minimum. For
    `callback`, `cancel`, `trace` and errors see `unwrap`.

    Rudin, Osher and Fatemi 1992; Almeida and Figueiredo 2013; Zhang, Peng, Ouyang and Deng 2019, section 4.3.
    """
    return _restored("deblur", image, psf, psf_center, mask, truth, settings, callback, cancel, trace)


def denoise(
    image: ArrayLike,
    *,
    truth: ArrayLike | None = None,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[RestoreSettings],
) -> tuple[NDArray[np.float64], Info]:
    """Takes noise out of an image by least total variation. See `deblur`."""
    return _restored("denoise", image, None, None, None, truth, settings, callback, cancel, trace)


def inpaint(
    image: ArrayLike,
    mask: ArrayLike,
    *,
    truth: ArrayLike | None = None,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[RestoreSettings],
) -> tuple[NDArray[np.float64], Info]:
    """Fills the pixels of an image where `mask` (h, w) is 0 by least total variation. See `deblur`."""
    return _restored("inpaint", image, None, None, mask, truth, settings, callback, cancel, trace)


def wavefront(
    reference: ArrayLike,
    captured: ArrayLike,
    *,
    callback: Callback | None = None,
    cancel: Cancel | None = None,
    trace: bool = False,
    **settings: Unpack[WavefrontSettings],
) -> tuple[NDArray[np.float64], Info]:
    """The wavefront phi that a coded sensor has seen: captured(p + grad phi(p)) = reference(p) at every pixel p.

    Both images are (h, w) or (h, w, channels), of one size, 16 pixels at least. Returns phi (h, w) of mean 0, in
    square pixels times `scale`, and the info. For `callback`, `cancel`, `trace` and errors see `unwrap`.

    Zhang, Peng, Ouyang and Deng 2019, section 4.3.
    """
    one, two = _arrays.image(reference, "reference")[0], _arrays.image(captured, "captured")[0]
    phi, outcome = _core.wavefront(one, two, dict(settings), callback, cancel, trace)
    return phi, finish(outcome)
