"""Packages that some functions need and the package does not."""

from __future__ import annotations

import importlib
from typing import Any

from ._core import InputError


def extra(module: str, name: str, what: str) -> Any:
    """A module of another package, or an InputError that says how to have it: `what` needs it, `name` is its extra."""
    try:
        return importlib.import_module(module)
    except ImportError as e:
        # One that is there and broken says itself why.
        if e.name is not None and e.name.split(".")[0] != module.split(".")[0]:
            raise
        raise InputError(f"{what} needs {module.split('.')[0]}; pip install 'proxel[{name}]'") from e
