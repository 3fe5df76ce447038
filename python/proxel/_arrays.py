"""Arrays as the compiled part takes them: C order, float64 and uint32. Nothing is renumbered or repaired here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ._core import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

#: The largest index there can be: one less is the number that means none.
LARGEST = 2**32 - 2


class Faces(NamedTuple):
    """Polygons: the corners of all of them, where each begins, and back to the shape that they came in."""

    corners: NDArray[np.uint32]
    offsets: NDArray[np.uint32]
    restore: Callable[[NDArray[Any]], Any]


def real(array: ArrayLike, what: str) -> NDArray[np.float64]:
    """Numbers as float64 in C order; a copy only where they are not that already."""
    try:
        out = np.asarray(array)
    except ValueError as e:
        raise InputError(f"{what}: its rows have different lengths; give an array") from e
    if out.dtype.kind not in "iuf":
        raise InputError(f"{what}: its numbers are of type {out.dtype}; give integers or floats")
    return np.ascontiguousarray(out, dtype=np.float64)


def table(array: ArrayLike, columns: int, what: str) -> NDArray[np.float64]:
    """An array (n, columns); (columns,) is one row."""
    out = real(array, what)
    if out.ndim == 1 and out.size == columns:
        out = out.reshape(1, columns)
    if out.ndim != 2 or out.shape[1] != columns:
        raise InputError(f"{what}: its shape is {out.shape}; give (n, {columns})")
    return out


def points(array: ArrayLike, what: str = "V") -> NDArray[np.float64]:
    """Positions (n, 3); those of (n, 2) lie at z = 0."""
    out = real(array, what)
    if out.ndim != 2 or out.shape[1] not in (2, 3):
        raise InputError(f"{what}: its shape is {out.shape}; give positions (n, 3) or (n, 2)")
    if out.shape[1] == 2:
        out = np.concatenate([out, np.zeros((len(out), 1))], axis=1)
    return out


def vector(array: ArrayLike, n: int, what: str) -> NDArray[np.float64]:
    """n numbers, or one for all."""
    out = real(array, what)
    # An array in C order has a dimension at least.
    if np.ndim(array) == 0:
        return np.full(n, float(out[0]))
    if out.shape != (n,):
        raise InputError(f"{what}: its shape is {out.shape}; give {n} numbers, or one for all")
    return out


def indices(array: ArrayLike, what: str, item: str = "entry") -> NDArray[np.uint32]:
    """0-based indices of any integer type, or floats without a fraction, in the shape that they have."""
    try:
        out = np.asarray(array)
    except ValueError as e:
        raise InputError(f"{what}: its rows have different lengths; give an array") from e
    if out.size == 0:
        return np.ascontiguousarray(out, dtype=np.uint32)
    if out.dtype.kind not in "iuf":
        raise InputError(f"{what}: its numbers are of type {out.dtype}; give 0-based indices")
    # A comparison with NaN is false.
    wrong = ~((out >= 0) & (out <= LARGEST))
    if out.dtype.kind == "f":
        wrong |= out != np.floor(out)
    if wrong.any():
        row = int(np.argwhere(wrong)[0][0]) if out.ndim else 0
        value = out[wrong].ravel()[0] if out.ndim else out
        raise InputError(f"{what}: {item} {row} (0-based) has the index {value}; give 0-based vertex indices")
    return np.ascontiguousarray(out, dtype=np.uint32)


def index_list(array: ArrayLike, what: str) -> NDArray[np.uint32]:
    """Indices (n,); one alone is a list of it."""
    out = np.atleast_1d(indices(array, what))
    if out.ndim != 1:
        raise InputError(f"{what}: its shape is {out.shape}; give (n,) indices")
    return out


def elements(array: ArrayLike, columns: Sequence[int], what: str, item: str) -> NDArray[np.uint32]:
    """Elements (m, columns)."""
    out = indices(array, what, item)
    if out.size == 0 and out.ndim < 2:
        return np.zeros((0, columns[0]), np.uint32)
    if out.ndim != 2 or out.shape[1] not in columns:
        wanted = " or ".join(f"(m, {c})" for c in columns)
        raise InputError(f"{what}: its shape is {out.shape}; give {wanted}")
    return out


def faces(array: Any, what: str = "F") -> Faces:
    """Triangles (m, 3), quads (m, 4), polygons (m, k), or a sequence of faces of any sizes."""
    if not isinstance(array, np.ndarray) and not hasattr(array, "__array__"):
        sizes = [np.size(face) for face in array]
        if len(set(sizes)) > 1:
            flat = np.concatenate([np.ravel(face) for face in array])
            ends = np.cumsum([0, *sizes])
            try:
                corners = indices(flat, what)
            except InputError:
                # Once more, face by face, to name the one.
                for f, face in enumerate(array):
                    indices(np.ravel(face)[None, :], f"{what}: face {f} (0-based)")
                raise
            return Faces(corners, ends.astype(np.uint32), lambda a: np.split(a, ends[1:-1]))
    out = indices(array, what, "face")
    if out.size == 0:
        return Faces(np.zeros(0, np.uint32), np.zeros(1, np.uint32), lambda a: a.reshape(0, 3))
    if out.ndim != 2:
        raise InputError(f"{what}: its shape is {out.shape}; give faces (m, 3), (m, 4), or a list of faces")
    offsets = np.arange(len(out) + 1, dtype=np.uint32) * np.uint32(out.shape[1])
    return Faces(out.ravel(), offsets, lambda a: a.reshape(out.shape))


def targets(vertices: ArrayLike, places: ArrayLike, columns: int, names: tuple[str, str]) -> tuple[Any, Any]:
    """Vertices, and a place for each."""
    who, where = index_list(vertices, names[0]), table(places, columns, names[1])
    if len(who) != len(where):
        raise InputError(f"{names[1]}: there are {len(where)} for {len(who)} {names[0]}; give one for each")
    return who, where


def image(array: ArrayLike, what: str) -> tuple[NDArray[np.float64], bool]:
    """An image as (h, w, c), and whether it came with channels."""
    out = real(array, what)
    if out.ndim not in (2, 3):
        raise InputError(f"{what}: its shape is {out.shape}; give (h, w) or (h, w, channels)")
    return (out if out.ndim == 3 else out[:, :, None]), out.ndim == 3
