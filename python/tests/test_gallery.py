"""The gallery: every example runs as a user would run it, holds what it asserts, and leaves a picture of something."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"
NAMES = sorted(p.stem for p in EXAMPLES.glob("*.py") if p.stem != "meshes")


def pixels(path):
    """Width, height, and the bytes of the filtered rows of a PNG file."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", data[16:24])
    at, parts = 8, []
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        if data[at + 4 : at + 8] == b"IDAT":
            parts.append(data[at + 8 : at + 8 + length])
        at += 12 + length
    return width, height, zlib.decompress(b"".join(parts))


@pytest.mark.parametrize("name", NAMES)
def test_example(name, tmp_path):
    script, out = EXAMPLES / f"{name}.py", tmp_path / "out.png"
    assert len(script.read_text().splitlines()) < 40
    environment = {**os.environ, "RAYON_NUM_THREADS": "2"}
    run = subprocess.run([sys.executable, script, out], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout, "an example says what it has found"
    width, height, raw = pixels(out)
    # An empty picture has a colour or two.
    assert width >= 64 and height >= 64 and len(set(raw)) > 30
    kept = os.environ.get("PROXEL_GALLERY")
    if kept:
        Path(kept).mkdir(parents=True, exist_ok=True)
        (Path(kept) / f"{name}.png").write_bytes(out.read_bytes())


def test_the_gallery_is_one():
    assert len(NAMES) >= 12
