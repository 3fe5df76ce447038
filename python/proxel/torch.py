"""`deform` and `unwrap` as functions that torch differentiates. Needs the package torch.

Gradients are those of `Info.adjoint`: the implicit function theorem, one factor of the true Hessian a backward pass.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from . import _differentiable as _shared
from ._core import InputError
from ._info import Info

__all__ = ["deform", "unwrap"]


class _Solve(torch.autograd.Function):
    """Arguments by name in, the result out. What the run is is kept in `box`."""

    @staticmethod
    def forward(
        ctx: Any, solve: Callable[..., tuple[Any, Info]], names: list[str], box: list[Info], *values: Any
    ) -> torch.Tensor:
        given = {name: _shared.number(_numpy(value)) for name, value in zip(names, values, strict=True)}
        out, info = solve(**given)
        ctx.info, ctx.names = info, names
        ctx.like = [(tuple(value.shape), value.dtype, value.device) for value in values]
        box.append(info)
        first = values[0]
        return torch.as_tensor(out, dtype=first.dtype, device=first.device)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, slope: torch.Tensor) -> tuple[Any, ...]:
        found = ctx.info.adjoint(_numpy(slope))
        out = []
        for name, (shape, dtype, device), wanted in zip(ctx.names, ctx.like, ctx.needs_input_grad[3:], strict=True):
            gradient = _shared.gradient(found, name, shape) if wanted else None
            out.append(None if gradient is None else torch.as_tensor(gradient, dtype=dtype, device=device))
        return (None, None, None, *out)


def _numpy(value: torch.Tensor) -> np.ndarray[Any, Any]:
    return value.detach().cpu().numpy()


def _run(solve: Callable[..., tuple[Any, Info]], allowed: tuple[str, ...], given: dict[str, Any]) -> Any:
    tensors = {name: value for name, value in given.items() if isinstance(value, torch.Tensor)}
    unknown = sorted(name for name in set(tensors) - set(allowed) if tensors[name].requires_grad)
    if unknown:
        raise InputError(f"there is no gradient in {unknown[0]}; those that there are: {', '.join(allowed)}")
    rest = {name: value for name, value in given.items() if name not in tensors}
    rest.update({name: _numpy(tensors.pop(name)) for name in list(tensors) if name not in allowed})
    if not isinstance(tensors.get("V"), torch.Tensor):
        raise InputError("V: give a tensor; its type and device are those of the result")
    names = ["V", *(name for name in tensors if name != "V")]
    box: list[Info] = []
    out = _Solve.apply(lambda **more: solve(**more, **rest), names, box, *(tensors[name] for name in names))
    return out, box[0]


def deform(V: torch.Tensor, T: Any, **given: Any) -> tuple[torch.Tensor, Info]:
    """`proxel.deform` of tensors: differentiable in `V` (n, 3), `targets` (p, 3), `forces` (n, 3), `young` and
    `poisson`, where these are tensors. Returns positions, of the type and on the device of V, and the info.

    Other arguments are those of `proxel.deform`; it is solved on the CPU in float64. The backward pass raises
    InputError where the run did not converge.
    """
    return _run(_shared.deform, _shared.BODY, {"V": V, "T": T, **given})


def unwrap(V: torch.Tensor, F: Any, **given: Any) -> tuple[torch.Tensor, Info]:
    """`proxel.unwrap` of tensors, not packed: differentiable in `V` (n, 3) and `targets` (p, 2), the places of pins.

    Where nothing or one vertex is pinned, what a loss sees of motions of the map counts for nothing: see
    `Info.adjoint`.
    """
    return _run(_shared.unwrap, _shared.MAP, {"V": V, "F": F, **given})
