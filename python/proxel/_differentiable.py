"""What the modules for torch and jax have in common."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import _bodies, _maps
from ._core import InputError
from ._info import Gradients, Info

#: The arguments of `deform` with a gradient.
BODY = ("V", "targets", "forces", "young", "poisson")

#: Those of `unwrap`.
MAP = ("V", "targets")


def deform(V: Any, T: Any, **given: Any) -> tuple[Any, Info]:
    """`proxel.deform`."""
    return _bodies.deform(V, T, **given)


def unwrap(V: Any, F: Any, **given: Any) -> tuple[Any, Info]:
    """`proxel.unwrap`, in units of V."""
    if given.setdefault("pack", False):
        raise InputError("there are no gradients through packing; leave pack out")
    return _maps.unwrap(V, F, **given)


def number(value: np.ndarray[Any, Any]) -> Any:
    """float64; an array without dimensions is a number."""
    value = np.asarray(value, dtype=np.float64)
    return float(value) if value.ndim == 0 else value


def gradient(found: Gradients, name: str, shape: tuple[int, ...]) -> Any:
    """The gradient in an argument, of its shape."""
    out = getattr(found, name)
    if out is None:
        raise InputError(f"there is no gradient in {name} where moduli are given by mu; give it as no tensor")
    return np.asarray(out, dtype=np.float64).reshape(shape)
