"""Gathers the pages of the site and builds it: `cargo xtask site --out DIR` calls this.

Pages are those of docs/ and of the root, the reference of scenes and recipes from their schemas, and the gallery from
python/examples, which are run for their pictures. Links are made to fit; what leads out of the site becomes text.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
#: Documents at the root that are pages; README.md says what start.md says, and more about the repository.
AT_ROOT = ("ARCHITECTURE.md", "CONTRIBUTING.md", "STYLE.md", "CHANGELOG.md")
INDEX = "start.md"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="the folder for the site")
    parser.add_argument("--program", required=True, help="the command proxel, for its schemas")
    parser.add_argument("--pictures", type=Path, help="pictures of the gallery; the examples are run without it")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        pages = Path(folder, "pages")
        shutil.copytree(ROOT / "docs", pages, ignore=shutil.ignore_patterns("site", "*.md"))
        sources = {p.name: p for p in [*(ROOT / "docs").glob("*.md"), *(ROOT / name for name in AT_ROOT)]}
        for name, path in sources.items():
            text = page(path.read_text(encoding="utf-8"), path.parent, set(sources))
            (pages / ("index.md" if name == INDEX else name)).write_text(text, encoding="utf-8")
        for what in ("scene", "recipe"):
            printed = subprocess.run([given.program, "schema", what], check=True, capture_output=True, text=True).stdout
            (pages / f"{what}.md").write_text(reference(what, json.loads(printed)), encoding="utf-8")
        gallery(pages, given.pictures)
        shutil.copy(HERE / "mkdocs.yml", folder)
        shutil.copy(HERE / "extra.css", pages)
        out = given.out.resolve()
        # Not --quiet: warnings that are not said are not counted either.
        command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(out)]
        # Its theme advertises on standard error otherwise.
        environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
        run = subprocess.run(command, cwd=folder, env=environment)
    if run.returncode == 0:
        count = len(list(out.glob("*.html")))
        print(f"{count} pages in {out}, every link and anchor followed")
    return run.returncode


def page(text: str, folder: Path, known: set[str]) -> str:
    """A document as Python-Markdown has it: links, lists, and no lines of Rust that documentation hides."""
    # Links first, as some go on in the next line; not in code.
    parts = re.split(r"(^```.*?^```$)", text, flags=re.M | re.S)
    pattern = r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)"
    parts[::2] = [re.sub(pattern, lambda m: link(m, folder, known), part) for part in parts[::2]]
    text = "".join(parts)
    out: list[str] = []
    fence: str | None = None
    in_list = False
    for line in text.splitlines():
        mark = re.match(r"\s*```(\w*)", line)
        if mark:
            fence = mark[1] if fence is None else None
            out.append(line)
            continue
        if fence is not None:
            if fence == "rust" and re.match(r"#( |$)", line):
                continue
            out.append(line)
            continue
        item = re.match(r"( *)([-*]|\d+\.) ", line)
        # A list begins after an empty line, and what belongs to an item is indented by four.
        if item and not item[1] and out and out[-1].strip() and not in_list:
            out.append("")
        in_list = bool(item) or (in_list and (not line.strip() or line.startswith("  ")))
        if in_list and re.match(r" {2,3}\S", line):
            line = "    " + line.lstrip()
        out.append(line)
    return "\n".join(out) + "\n"


def link(m: re.Match[str], folder: Path, known: set[str]) -> str:
    picture, text, target = m[1], m[2], m[3]
    path, _, anchor = target.partition("#")
    if "://" in target or not path:
        return m[0]
    there = (folder / path).resolve()
    if there.name in known and there.parent in (ROOT, ROOT / "docs"):
        name = "index.md" if there.name == INDEX else there.name
        return f"[{text}]({name}{'#' + anchor if anchor else ''})"
    if there.is_relative_to(ROOT / "docs"):
        return f"{picture}[{text}]({there.relative_to(ROOT / 'docs').as_posix()})"
    # Of the repository, which the site knows no address of.
    where = there.relative_to(ROOT).as_posix()
    return text if where in text else f"{text} (`{where}`)"


def kind(schema: dict, definitions: dict) -> str:
    """What a value is, in words, with links to what has a section."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[-1]
        return f"[{name}](#{name.lower()})"
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(v)}`" for v in schema["enum"])
    for key in ("anyOf", "oneOf", "allOf"):
        if key in schema:
            parts = [kind(s, definitions) for s in schema[key] if s.get("type") != "null"]
            return " or ".join(dict.fromkeys(parts))
    types = schema.get("type", "anything")
    types = [t for t in (types if isinstance(types, list) else [types]) if t != "null"]
    if "array" in types:
        inner = schema.get("prefixItems") or ([schema["items"]] if isinstance(schema.get("items"), dict) else [])
        low, high = schema.get("minItems"), schema.get("maxItems")
        size = f" of {low}" if low is not None and low == high else ""
        words = ", ".join(dict.fromkeys(kind(s, definitions) for s in inner)) or "anything"
        return f"list{size}: {words}"
    if types == ["object"]:
        inside = schema.get("additionalProperties")
        if isinstance(inside, dict):
            return f"table of names, each {kind(inside, definitions)}"
        if schema.get("properties"):
            return "; ".join(f"`{k}` = {kind(v, definitions)}" for k, v in schema["properties"].items())
    return " or ".join(types)


def cell(text: str) -> str:
    """What stands in a table: one line, without the links of Rust's documentation and the lines of HTML."""
    text = re.sub(r"\[(`[^`]+`)\](?!\()", r"\1", text)
    return text.replace("\n", " ").replace("|", "\\|").replace("<", "&lt;")


def rows(schema: dict, definitions: dict) -> list[str]:
    out = ["| key | what it is | default | |", "|---|---|---|---|"]
    required = set(schema.get("required", []))
    for name, value in sorted(schema.get("properties", {}).items(), key=lambda kv: kv[0] not in required):
        default = "needed" if name in required else f"`{json.dumps(value['default'])}`" if "default" in value else ""
        text = value.get("description", "")
        out.append(f"| `{name}` | {cell(kind(value, definitions))} | {cell(default)} | {cell(text)} |")
    return out


def reference(what: str, schema: dict) -> str:
    """A page of a schema: a section for each of its parts, with a table of keys or of choices."""
    definitions = schema.get("$defs", {})
    command = "simulate" if what == "scene" else "shape"
    lines = [
        f"# Reference of {what}s",
        "",
        f"What `proxel {command}` reads, as TOML or JSON: made from the schema that `proxel schema {what}` prints. "
        f"[{command}]({command}.md) explains it.",
        "",
        schema.get("description", ""),
        "",
        *rows(schema, definitions),
        "",
    ]
    for name, part in sorted(definitions.items(), key=lambda kv: kv[0].lower()):
        lines += [f"## {name} {{ #{name.lower()} }}", "", cell(part.get("description", "")), ""]
        choices = next((part[k] for k in ("oneOf", "anyOf") if k in part), None)
        if choices is not None:
            lines += ["| one of | |", "|---|---|"]
            lines += [f"| {cell(kind(c, definitions))} | {cell(c.get('description', ''))} |" for c in choices]
        elif part.get("properties"):
            lines += rows(part, definitions)
        else:
            lines.append(cell(kind(part, definitions)))
        lines.append("")
    return "\n".join(lines)


def gallery(pages: Path, pictures: Path | None) -> None:
    """A page with every example: what it says of itself, its picture, and its code."""
    folder = pages / "gallery"
    folder.mkdir()
    examples = sorted(p for p in (ROOT / "python" / "examples").glob("*.py") if p.stem != "meshes")
    lines = [
        "# Gallery",
        "",
        "Short scripts, each with the picture that it leaves; they are run with the tests of the package. Meshes and",
        "images are made by `python/examples/meshes.py`, which is at the end.",
        "",
    ]
    for example in examples:
        text = example.read_text(encoding="utf-8")
        tree = ast.parse(text)
        said = ast.get_docstring(tree) or ""
        # What it says of itself stands above its picture.
        first = tree.body[0].end_lineno if said else 0
        target = folder / f"{example.stem}.png"
        if pictures is not None:
            shutil.copy(pictures / target.name, target)
        else:
            subprocess.run([sys.executable, example, target], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        code = "\n".join(text.splitlines()[first:]).strip()
        lines += [f"## {example.stem.replace('_', ' ').capitalize()}", "", said, ""]
        lines += [f"![{said}](gallery/{target.name})", "", f'```python title="{example.name}"', code, "```", ""]
    meshes = (ROOT / "python" / "examples" / "meshes.py").read_text(encoding="utf-8")
    lines += ["## What they are made of", "", '```python title="meshes.py"', meshes.strip(), "```", ""]
    (pages / "gallery.md").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
