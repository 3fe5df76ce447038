"""Problems put together by hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _core
from ._bodies import checked_energy
from ._core import Cancel, InputError
from ._info import Info, finish

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self, Unpack

    from ._settings import ProblemSettings
    from ._types import Callback, Energy

    Projection = Callable[[NDArray[np.float64]], Any]


class Problem:
    """Points under energies and constraints, built-in ones and ones written in numpy.

    ::

        min over X   sum of energies + sum of w/2 dist(rows of X, C)^2 over soft sets C
        subject to   rows of X in C for hard sets, X = targets at fixed points

    `X` (n, 3) is where points begin. Every method but `solve` adds something, and returns the problem; nothing is copied
    from it or to it later.
    """

    def __init__(self, X: ArrayLike) -> None:
        self._start = _arrays.table(X, 3, "X")
        self._input: dict[str, Any] = {key: [] for key in ("fixed", "springs", "forces", "fairing", "parts")}

    def fix(self, points: ArrayLike, targets: ArrayLike | None = None) -> Self:
        """Holds `points` (p,) at `targets` (p, 3), or where they begin."""
        who = _arrays.index_list(points, "fix")
        if targets is None:
            if who.size and int(who.max()) >= len(self._start):
                raise InputError(f"fix: point {int(who.max())} does not exist; there are {len(self._start)} (0-based)")
            targets = self._start[who]
        self._input["fixed"].append(_arrays.targets(who, targets, 3, ("fix", "targets")))
        return self

    def springs(self, points: ArrayLike, targets: ArrayLike, stiffness: ArrayLike) -> Self:
        """k/2 |x - t|^2 of `points` (p,), `targets` (p, 3) and `stiffness` (p,) or one for all."""
        who, where = _arrays.targets(points, targets, 3, ("springs", "targets"))
        self._input["springs"].append((who, where, _arrays.vector(stiffness, len(who), "stiffness")))
        return self

    def forces(self, points: ArrayLike, forces: ArrayLike) -> Self:
        """-b . x of `points` (p,) and `forces` (p, 3)."""
        self._input["forces"].append(_arrays.targets(points, forces, 3, ("forces", "forces")))
        return self

    def fairing(self, F: Any, weight: float) -> Self:
        """w/2 |L (X - X0)|^2: holds the shape of the faces `F` as it is at the start. Liu et al. 2011."""
        faces = _arrays.faces(F)
        self._input["fairing"].append(((faces.corners, faces.offsets), float(weight)))
        return self

    def near(self, points: ArrayLike, surface: tuple[ArrayLike, Any], weight: float) -> Self:
        """w/2 dist(x, surface)^2 of `points` (p,); the surface is a pair (V, F)."""
        faces = _arrays.faces(surface[1], "faces of the surface")
        part = {
            "points": _arrays.index_list(points, "near"),
            "surface": (_arrays.points(surface[0], "surface"), (faces.corners, faces.offsets)),
            "weight": float(weight),
        }
        self._input["parts"].append(part)
        return self

    def elastic(self, T: ArrayLike, *, rest: ArrayLike | None = None, **material: Any) -> Self:
        """The energy of tetrahedra (m, 4), triangles (m, 3) or edges (m, 2) of a material: `material` (a name or a
        dict), `young`, `poisson`, `mu`, `lambda_`, with the defaults of `deform`. `rest` (n, 3) is the rest shape; the
        start without it."""
        self._input["parts"].append(
            {
                "rest": self._rest(rest),
                "elements": _arrays.elements(T, [4, 3, 2], "T", "element"),
                "material": self._material(material),
            }
        )
        return self

    def energy(self, T: ArrayLike, energy: Energy, *, rest: ArrayLike | None = None, **like: Any) -> Self:
        """An energy of your own of tetrahedra (m, 4): a function of deformation gradients F (m, 3, 3) that returns
        densities psi (m,) over rest volume and dpsi/dF (m, 3, 3), as that of `deform`. Its stiffness is that of a
        material, which keywords name; what that is like at rest preconditions. Needs `method="lbfgs"`.
        """
        self._input["parts"].append(
            {
                "rest": self._rest(rest),
                "elements": _arrays.elements(T, [4], "T", "tetrahedron"),
                "energy": (checked_energy(energy), bool(getattr(energy, "barrier", False))),
                "material": self._material(like),
            }
        )
        return self

    def project(
        self,
        elements: ArrayLike,
        projection: Projection,
        *,
        hard: bool = True,
        weight: float = 1.0,
        centred: bool = True,
    ) -> Self:
        """A set for each of `elements` (m, k), by its nearest points: `projection` is a function of rows (m, k, 3) that
        returns the points of the sets nearest to them, of that shape. It must not change its argument.

        Rows are the corners of elements from their mean; as they are with `centred=False`, for sets that lie somewhere.
        A hard set holds, and `weight` is the penalty mu of the splitting, which steers the iteration and not its end; a
        soft one counts by weight/2 dist^2.
        """
        self._input["parts"].append(
            {
                "elements": _arrays.elements(elements, [np.shape(elements)[-1]], "elements", "element"),
                "projection": _nearest(projection),
                "centred": bool(centred),
                "hard": bool(hard),
                "weight": float(weight),
            }
        )
        return self

    def solve(
        self,
        *,
        callback: Callback | None = None,
        cancel: Cancel | None = None,
        trace: bool = False,
        **settings: Unpack[ProblemSettings],
    ) -> tuple[NDArray[np.float64], Info]:
        """Points (n, 3) that solve it, fixed ones bit for bit, and the info; `info.violation` is the largest distance
        of a hard set's element from it, over the extent of the start.

        `method` is "admm" (z-x-u), "aa-admm" (under Anderson acceleration), "lbfgs" (all but hard sets), "newton"
        (elastic elements alone) or "auto". With projections and energies in numpy Python's lock is taken for each call
        of theirs, one for all elements. For `callback`, `cancel`, `trace` and errors see `unwrap`; what a function of
        yours raises ends the run and is raised here.

        Zhang, Peng, Ouyang and Deng 2019, A(29); Bouaziz et al. 2012.
        """
        X, outcome = _core.problem({"start": self._start, **self._input}, dict(settings), callback, cancel, trace)
        return X, finish(outcome)

    def _rest(self, rest: ArrayLike | None) -> NDArray[np.float64]:
        out = self._start if rest is None else _arrays.table(rest, 3, "rest")
        if len(out) != len(self._start):
            raise InputError(f"rest: it has {len(out)} rows for {len(self._start)} points; give one for each")
        return out

    @staticmethod
    def _material(given: dict[str, Any]) -> dict[str, Any]:
        known = ("material", "young", "poisson", "mu", "lambda_")
        unknown = sorted(set(given) - set(known))
        if unknown:
            raise InputError(f"a material has no `{unknown[0]}`; known are {', '.join(known)}")
        return given


def _nearest(projection: Projection) -> Projection:
    """With results as the compiled part takes them."""

    def nearest(rows: NDArray[np.float64]) -> NDArray[np.float64]:
        out = _arrays.real(projection(rows), "projection")
        if out.shape != rows.shape:
            raise InputError(f"projection: its result has the shape {out.shape}; return {rows.shape}")
        if not np.isfinite(out).all():
            element = int(np.argwhere(~np.isfinite(out).all((1, 2)))[0][0])
            raise InputError(f"projection: its result for element {element} (0-based) is not finite")
        return out

    return nearest
