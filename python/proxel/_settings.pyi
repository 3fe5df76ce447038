"""Settings by keyword, with their defaults. Written by tools/settings_stub.py."""

from collections.abc import Mapping, Sequence
from typing import Any

from typing_extensions import TypedDict

class UnwrapSettings(TypedDict, total=False):
    """Of unwrap."""

    method: str  # 'auto'
    energy: str  # 'symmetric-dirichlet'
    admm: Mapping[str, Any]
    bcqn: Mapping[str, Any]
    newton: Mapping[str, Any]
    patience: int  # 4
    longest: int  # 30
    stride: float  # 1024.0
    shift: float  # 1e-08
    proximal: float  # 0.0001
    proximal_cm: float  # 1e-07
    bijective: bool  # False
    fixed_boundary: bool  # False
    max_stretch: float | None  # None
    pack: bool  # True
    padding: float  # 2.0
    resolution: int  # 1024
    density: float | None  # None
    tol: float  # 1e-09
    max_iters: int  # 5000
    time_limit: float | None  # None
    threads: int | None  # None

class DeformSettings(TypedDict, total=False):
    """Of deform."""

    method: str  # 'auto'
    schedule: str  # 'default'
    admm: Mapping[str, Any]
    lbfgs: Mapping[str, Any]
    bcqn: Mapping[str, Any]
    anderson: Mapping[str, Any]
    newton: Mapping[str, Any]
    material: str | Mapping[str, Any]
    materials: Mapping[Any, Mapping[str, Any]]
    density: float  # 0.0
    gravity: Sequence[float]  # [0.0, 0.0, 0.0]
    bending: float  # 0.0
    strain_limit: Sequence[float] | None  # None
    planar: bool  # False
    mixed: bool  # False
    fix_orientation: bool  # False
    surface: str  # 'auto'
    resolution: int  # 24
    tol: float  # 1e-09
    patch_tol: float | None  # None
    max_iters: int  # 5000
    time_limit: float | None  # None
    threads: int | None  # None
    young: float  # 10000000.0
    poisson: float  # 0.45
    mu: float | None  # None
    lambda_: float | None  # None

class ShapeSettings(TypedDict, total=False):
    """Of planarize, shape."""

    method: str  # 'auto'
    mu: float
    anderson: int  # 6
    closeness: float  # 1.0
    fairing: float
    tol: float  # 1e-09
    max_iters: int  # 5000
    memory: float  # 8000000000.0
    time_limit: float | None  # None
    threads: int | None  # None

class WireSettings(TypedDict, total=False):
    """Of wire."""

    edge_length: float | None  # None
    min_angle: float  # 45.0
    max_angle: float  # 135.0
    subdivide: int  # 0
    method: str  # 'auto'
    mu: float  # 1000.0
    anderson: int  # 6
    closeness: float  # 1.0
    fairing: float  # 0.0
    tol: float  # 1e-09
    max_iters: int  # 5000
    memory: float  # 8000000000.0
    time_limit: float | None  # None
    threads: int | None  # None

class ProblemSettings(TypedDict, total=False):
    """Of problem."""

    method: str  # 'auto'
    anderson: int  # 6
    lbfgs: Mapping[str, Any]
    tol: float  # 1e-09
    max_iters: int  # 5000
    time_limit: float | None  # None
    threads: int | None  # None

class GeodesicSettings(TypedDict, total=False):
    """Of geodesic."""

    method: str  # 'auto'
    form: str  # 'faces'
    time: float  # 1.0
    mu: float  # 100.0
    anderson: int  # 6
    tol: float  # 1e-09
    max_iters: int  # 5000
    time_limit: float | None  # None
    threads: int | None  # None

class RestoreSettings(TypedDict, total=False):
    """Of deblur, denoise, inpaint."""

    method: str  # 'auto'
    boundary: str  # 'auto'
    data: str  # 'quadratic'
    threshold: float | None  # None
    scale: int  # 1
    noise: float | None  # None
    lambda_: float | None  # None
    regulariser: str  # 'auto'
    tgv_ratio: float  # 2.0
    variation: str  # 'vectorial'
    range: Sequence[float] | None  # None
    penalty: float | None  # None
    relaxation: float  # 1.8
    anderson: int  # 6
    tile: int | None  # None
    tol: float  # 0.0001
    max_iters: int  # 5000
    time_limit: float | None  # None
    threads: int | None  # None

class WavefrontSettings(TypedDict, total=False):
    """Of wavefront."""

    method: str  # 'auto'
    beta: float  # 30.0
    mu: float  # 100.0
    margin: int  # 16
    coarsest: int  # 64
    warps: int  # 3
    texture: bool  # True
    median: bool  # True
    scale: float  # 1.0
    anderson: int  # 6
    relaxation: float  # 1.8
    restart: int  # 10
    tol: float  # 0.01
    max_iters: int  # 500
    time_limit: float | None  # None
    threads: int | None  # None
