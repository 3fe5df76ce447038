"""Elastic bodies at rest."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _core
from ._core import Cancel, InputError
from ._info import Info, finish

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Unpack

    from ._settings import DeformSettings
    from ._types import Callback, Energy


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
        where = begin[who] if targets is None else padded(targets, dim, "targets")
        if len(who) != len(where):
            raise InputError(f"targets: there are {len(where)} for {len(who)} pins; give one for each")
        more["pins"] = (who, np.ascontiguousarray(where))
    elif targets is not None:
        raise InputError("targets are those of pins; give pins")
    if springs is not None:
        who = _arrays.index_list(springs[0], "springs")
        where = padded(springs[1], dim, "springs")
        if len(who) != len(where):
            raise InputError(f"springs: there are {len(where)} targets for {len(who)} vertices; give one for each")
        more["springs"] = (who, where, _arrays.vector(springs[2], len(who), "springs"))
    if obstacles is not None:
        planes = [np.concatenate([_arrays.real(v, "obstacles") for v in plane]) for plane in obstacles]
        more["obstacles"] = _arrays.table(np.array(planes), 6, "obstacles") if planes else None
    more["start"] = None if start is None else padded(start, dim, "start")
    numbers = None if regions is None else _arrays.real(regions, "regions")
    more["regions"] = None if numbers is None else np.ascontiguousarray(numbers, dtype=np.int32)
    more["forces"] = None if forces is None else padded(forces, dim, "forces")
    more["pressure"] = None if pressure is None else float(pressure)
    more["reference"] = None if reference is None else padded(reference, dim, "reference")
    more["energy"] = None if energy is None else (checked_energy(energy), bool(getattr(energy, "barrier", False)))
    return points, dim, more


def checked_energy(energy: Energy) -> Energy:
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


def padded(array: ArrayLike, dim: int, what: str) -> NDArray[np.float64]:
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
