"""`deform` and `unwrap` as functions that jax differentiates and compiles. Needs the package jax.

Gradients are those of `Info.adjoint`: the implicit function theorem, one factor of the true Hessian a backward pass.
Numbers are float64 where jax is told to have such (`jax.config.update("jax_enable_x64", True)`), else float32.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from . import _differentiable as _shared
from ._core import InputError
from ._info import Info

__all__ = ["deform", "unwrap"]

#: Runs whose backward pass may still come. One that has been forgotten is solved again.
_KEPT = 8


def _run(solve: Callable[..., tuple[Any, Info]], allowed: tuple[str, ...], given: dict[str, Any], columns: int) -> Any:
    names = [name for name in allowed if given.get(name) is not None and (name == "V" or _is_jax(given[name]))]
    rest = {name: value for name, value in given.items() if name not in names}
    first = jnp.asarray(given["V"])
    values = tuple(jnp.asarray(given[name], dtype=first.dtype) for name in names)
    shape = jax.ShapeDtypeStruct((first.shape[0], columns or first.shape[1]), first.dtype)
    runs: OrderedDict[bytes, Info] = OrderedDict()

    def once(*values: Any) -> tuple[Any, Info]:
        given = {name: _shared.number(np.asarray(value)) for name, value in zip(names, values, strict=True)}
        return solve(**given, **rest)

    def forward(*values: Any) -> Any:
        out, info = once(*values)
        runs[_key(values)] = info
        while len(runs) > _KEPT:
            runs.popitem(last=False)
        if out.shape != shape.shape:
            raise InputError(f"the map has {len(out)} coordinates, since it was cut; give it with its seams open")
        return np.asarray(out, dtype=shape.dtype)

    def backward(slope: Any, *values: Any) -> tuple[Any, ...]:
        info = runs.get(_key(values)) or once(*values)[1]
        found = info.adjoint(np.asarray(slope, dtype=np.float64))
        return tuple(
            np.asarray(_shared.gradient(found, name, np.shape(value)), dtype=np.asarray(value).dtype)
            for name, value in zip(names, values, strict=True)
        )

    @jax.custom_vjp
    def call(*values: Any) -> Any:
        return jax.pure_callback(forward, shape, *values)

    def pull(values: Any, slope: Any) -> Any:
        shapes = tuple(jax.ShapeDtypeStruct(v.shape, v.dtype) for v in values)
        return jax.pure_callback(backward, shapes, slope, *values)

    call.defvjp(lambda *values: (call(*values), values), pull)
    return call(*values)


def _is_jax(value: Any) -> bool:
    return isinstance(value, jax.Array)


def _key(values: tuple[Any, ...]) -> bytes:
    return b"".join(np.asarray(value).tobytes() for value in values)


def deform(V: Any, T: Any, **given: Any) -> Any:
    """`proxel.deform` of arrays of jax: differentiable in `V` (n, 3), `targets` (p, 3), `forces` (n, 3), `young` and
    `poisson`, where these are such arrays. Returns positions of the shape and type of V.

    Other arguments are those of `proxel.deform`; it is solved on the CPU in float64, within `jax.jit` by a callback.
    A gradient raises where the run did not converge.
    """
    return _run(_shared.deform, _shared.BODY, {"V": V, "T": T, **given}, 0)


def unwrap(V: Any, F: Any, **given: Any) -> Any:
    """`proxel.unwrap` of arrays of jax, not packed: differentiable in `V` (n, 3) and `targets` (p, 2), the places of
    pins. Returns uv (n, 2); a surface that has to be cut has more, and is refused.

    Where nothing or one vertex is pinned, what a loss sees of motions of the map counts for nothing: see
    `Info.adjoint`.
    """
    return _run(_shared.unwrap, _shared.MAP, {"V": V, "F": F, **given}, 2)
