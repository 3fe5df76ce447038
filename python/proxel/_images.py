"""Images: total variation, wavefronts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _core
from ._core import Cancel, InputError
from ._info import Info, finish

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Unpack

    from ._settings import RestoreSettings, WavefrontSettings
    from ._types import Callback


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
