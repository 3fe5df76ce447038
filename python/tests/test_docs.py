"""The code of the documents runs, each document from top to bottom, in a folder of its own. Their commands are tried by
crates/cli/tests/documents.rs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
PAGES = sorted(
    str(p.relative_to(ROOT)) for p in [*ROOT.glob("docs/*.md"), *ROOT.glob("*.md"), ROOT / "python/README.md"]
)


def blocks(name, language):
    text = (ROOT / name).read_text()
    found = re.finditer(rf"^```{language}\n(.*?)^```$", text, re.M | re.S)
    return [(text[: b.start()].count("\n") + 1, b[1]) for b in found]


# README.md names meshes that the reader has; docs/python.md has the same calls with arrays.
@pytest.mark.parametrize("name", [n for n in PAGES if n != "README.md" and blocks(n, "python")])
def test_code_of(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scope: dict[str, object] = {}
    for line, code in blocks(name, "python"):
        if "interop" in code:
            pytest.importorskip("scipy")
        # Lines of a traceback are those of the document.
        exec(compile("\n" * line + code, name, "exec"), scope)
    assert "uv.png" not in (ROOT / name).read_text() or (tmp_path / "uv.png").stat().st_size > 1000


def test_pages_with_code_are_found():
    found = {n for n in PAGES if blocks(n, "python")}
    assert {
        "docs/python.md",
        "docs/start.md",
        "docs/compare.md",
        "docs/troubleshooting.md",
        "python/README.md",
    } <= found
