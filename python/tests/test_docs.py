"""The code of the documents runs, each document from top to bottom, in a folder of its own."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.parametrize("name", ["docs/python.md", "docs/gradients.md", "python/README.md"])
def test_code_of(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / name).read_text()
    blocks = list(re.finditer(r"^```python\n(.*?)^```$", text, re.M | re.S))
    assert blocks
    scope: dict[str, object] = {}
    for block in blocks:
        line = text[: block.start()].count("\n") + 1
        # Lines of a traceback are those of the document.
        exec(compile("\n" * line + block[1], name, "exec"), scope)
    assert (tmp_path / "uv.png").exists() or "uv.png" not in text
