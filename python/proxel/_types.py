"""What callers give that is no array."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._core import Progress

#: Called where a run stands; what is true ends it.
Callback = Callable[[Progress], object]

#: Deformation gradients (m, 3, 3) to densities (m,) and their derivatives (m, 3, 3).
Energy = Callable[[NDArray[np.float64]], tuple[Any, Any]]
