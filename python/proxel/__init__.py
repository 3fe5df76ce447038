"""Proxel minimises deformation energies under constraints.

Arrays come in any type, order and as views, are never changed and never renumbered; what comes out is float64, and
int32 for indices, in C order. Settings are given by keyword, with the names and defaults of the command line and
the Rust library (`proxel.settings("unwrap")`). Python's lock is released while anything is solved, and Ctrl-C ends
a run.

`proxel.batch` does the same to many inputs, `proxel.interop` takes and gives the objects of other packages.
"""

from typing import TYPE_CHECKING, Any

from ._bodies import deform
from ._core import BusyError, Cancel, InputError, Progress, SolveError, __version__
from ._images import deblur, denoise, inpaint, wavefront
from ._info import Gradients, Info, Trace, settings
from ._job import Job
from ._live import Deformer, Standing, Unwrapper
from ._maps import unwrap
from ._problem import Problem
from ._simulate import Frame, Frames, Simulator, simulate
from ._surfaces import geodesic, planarize, shape, wire

__all__ = [
    "BusyError",
    "Cancel",
    "Deformer",
    "Frame",
    "Frames",
    "Gradients",
    "Info",
    "InputError",
    "Job",
    "Problem",
    "Progress",
    "Simulator",
    "SolveError",
    "Standing",
    "Trace",
    "Unwrapper",
    "__version__",
    "batch",
    "deblur",
    "deform",
    "denoise",
    "geodesic",
    "inpaint",
    "interop",
    "planarize",
    "settings",
    "shape",
    "simulate",
    "unwrap",
    "wavefront",
    "wire",
]


if TYPE_CHECKING:
    from . import batch, interop
else:

    def __getattr__(name: str) -> Any:
        # Imported when they are asked for: most programs need neither.
        if name in ("batch", "interop"):
            import importlib

            return importlib.import_module(f"{__name__}.{name}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
