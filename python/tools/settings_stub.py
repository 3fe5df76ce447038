"""Writes proxel/_settings.pyi from the settings of the compiled part, so that names and defaults come from one place.

    python tools/settings_stub.py [--check]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import proxel

STUB = Path(__file__).parent.parent / "proxel" / "_settings.pyi"

#: One class for the commands that have the same settings.
CLASSES = {
    "UnwrapSettings": ["unwrap"],
    "DeformSettings": ["deform"],
    "ShapeSettings": ["planarize", "shape"],
    "WireSettings": ["wire"],
    "ProblemSettings": ["problem"],
    "GeodesicSettings": ["geodesic"],
    "RestoreSettings": ["deblur", "denoise", "inpaint"],
    "WavefrontSettings": ["wavefront"],
}

#: What a default of None, or a name among other things, does not tell.
KNOWN = {
    "threads": "int | None",
    "tile": "int | None",
    "range": "Sequence[float] | None",
    "strain_limit": "Sequence[float] | None",
    "material": "str | Mapping[str, Any]",
    "materials": "Mapping[Any, Mapping[str, Any]]",
}

#: What may stand beside a section, as on the command line.
BESIDE = {"DeformSettings": {"young": 1e7, "poisson": 0.45, "mu": None, "lambda_": None}}


def kind(name: str, default: Any) -> str:
    """The type of a setting, from its default."""
    if name in KNOWN:
        return KNOWN[name]
    if default is None:
        return "float | None"
    if isinstance(default, bool):
        return "bool"
    if isinstance(default, dict):
        return "Mapping[str, Any]"
    if isinstance(default, list):
        return "Sequence[float]"
    return type(default).__name__


def text() -> str:
    """The stub."""
    lines = [
        '"""Settings by keyword, with their defaults. Written by tools/settings_stub.py."""',
        "",
        "from collections.abc import Mapping, Sequence",
        "from typing import Any",
        "",
        "from typing_extensions import TypedDict",
    ]
    for name, commands in CLASSES.items():
        defaults = [proxel.settings(command) for command in commands]
        if any(set(d) != set(defaults[0]) for d in defaults):
            raise SystemExit(f"{commands} have different settings")
        lines += ["", f"class {name}(TypedDict, total=False):", f'    """Of {", ".join(commands)}."""', ""]
        for key, default in {**defaults[0], **BESIDE.get(name, {})}.items():
            # A keyword of Python has an underscore at its end.
            key = "lambda_" if key == "lambda" else key
            values = {repr(d.get(key, default)) for d in defaults}
            shown = f"  # {values.pop()}" if len(values) == 1 and not isinstance(default, dict) else ""
            lines.append(f"    {key}: {kind(key, default)}{shown}")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Writes the stub, or says that it is not up to date."""
    wanted = text()
    if "--check" not in sys.argv:
        STUB.write_text(wanted)
    elif STUB.read_text() != wanted:
        raise SystemExit(f"{STUB} is not up to date; run python tools/settings_stub.py")


if __name__ == "__main__":
    main()
