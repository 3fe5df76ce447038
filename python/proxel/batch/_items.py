"""What a batch is over: a folder, a manifest, or a list."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .._core import InputError

#: What is an input when it lies in a folder that is searched, by job; others take meshes.
IMAGES = (".npy",)
MESHES = (".npz", ".obj", ".off", ".ply", ".stl", ".mesh", ".msh", ".vtk", ".vtu")
SCENES = (".toml", ".json")
#: Arguments whose files are part of an item: when their content changes it is another.
READ = ("mesh", "image", "scene", "recipe", "pins")
#: The argument that a path alone stands for.
INPUT = {
    "deblur": "image",
    "denoise": "image",
    "inpaint": "image",
    "simulate": "scene",
}


class Item(NamedTuple):
    """One input: its name among all, where its files are, and the arguments of the job."""

    id: str
    folder: str  # relative paths begin here
    arguments: dict[str, Any]

    def path(self, name: str | os.PathLike[str]) -> Path:
        """A file that an argument names."""
        return Path(self.folder, name)


def read_items(source: Any, job: str | None = None, out: str | os.PathLike[str] | None = None) -> list[Item]:
    """The items of a folder (all inputs of the job in it and below), of a manifest (.jsonl: an object, or a path, a
    line; .csv: a column an argument; .txt: a path a line), or of a list of dicts and paths.

    The key `id` of an item, which has to be unique, is its path where it has none, or its place in a list. Where the
    folder for results `out` lies in the folder that is searched, what is in it is no input. Raises InputError, with the
    line, for what is no item, and where a result would be written over an input.
    """
    key = INPUT.get(job or "", "mesh")
    if isinstance(source, (str, os.PathLike)):
        path = Path(source)
        if path.is_dir():
            return _checked(_folder(path, key, out), out)
        if not path.is_file():
            raise InputError(f"{path}: it is neither a folder nor a manifest; check the path")
        return _checked(_manifest(path, key), out)
    if isinstance(source, Mapping) or not isinstance(source, Iterable):
        raise InputError("source: give a folder, a manifest or a list of items")
    here = os.getcwd()
    entries = (_item(entry, here, key, f"item {k} (0-based)", str(k)) for k, entry in enumerate(source))
    return _checked(entries, out)


def _checked(items: Iterable[Item], folder: str | os.PathLike[str] | None) -> list[Item]:
    out = list(items)
    if not out:
        raise InputError("source: it has no items; give a folder with inputs, or a list of them")
    seen: dict[str, int] = {}
    for k, item in enumerate(out):
        # On some file systems names that differ in case only are one.
        name = str(output_name(item.id)).casefold()
        if name in seen:
            other = out[seen[name]].id
            raise InputError(
                f"item {k} (0-based): its id {item.id!r} and {other!r}, of item {seen[name]}, would leave one file; "
                "give them an `id` each"
            )
        seen[name] = k
        if folder is None:
            continue
        target = Path(folder, output_name(item.id)).resolve()
        if any(isinstance(v, str) and item.path(v).resolve() == target for v in item.arguments.values()):
            raise InputError(
                f"{target}: the result of {item.id!r} would be written over it; give another folder for results"
            )
    return out


def _folder(root: Path, key: str, out: str | os.PathLike[str] | None) -> list[Item]:
    results = None if out is None else Path(out).resolve()
    endings = {"image": IMAGES, "scene": SCENES}.get(key, MESHES)
    found = []
    for folder, inner, names in os.walk(root):
        # In place: os.walk goes on in what is left.
        inner[:] = sorted(n for n in inner if not n.startswith(".") and Path(folder, n).resolve() != results)
        for name in sorted(names):
            if not name.startswith(".") and Path(name).suffix.lower() in endings:
                found.append(Path(folder, name).relative_to(root).as_posix())
    return [Item(name, str(root.resolve()), {key: name}) for name in sorted(found)]


def _manifest(path: Path, key: str) -> Iterable[Item]:
    folder = str(path.resolve().parent)
    ending = path.suffix.lower()
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as e:
        raise InputError(f"{path}: it is no text in UTF-8 ({e.reason}); give a .jsonl, .csv or .txt manifest") from e
    if ending == ".csv":
        rows = csv.DictReader(text.splitlines(), strict=True)
        for row in rows:
            where = f"{path}: line {rows.line_num}"
            if None in row or None in row.values():
                raise InputError(f"{where}: it has not as many cells as the first line; correct the line")
            cells = {name: _cell(cell) for name, cell in row.items() if cell != ""}
            yield _item(cells, folder, key, where, None)
        return
    for number, line in enumerate(text.splitlines(), 1):
        where = f"{path}: line {number}"
        stripped = line.strip()
        if not stripped or stripped.startswith("#"):
            continue
        entry: Any = stripped
        if stripped[0] in '{"' and ending != ".txt":
            try:
                entry = json.loads(stripped)
            except ValueError as e:
                raise InputError(f"{where}: it is no JSON: {e}; correct the line") from e
        yield _item(entry, folder, key, where, None)


def _cell(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def _item(entry: Any, folder: str, key: str, where: str, name: str | None) -> Item:
    if isinstance(entry, (str, os.PathLike)):
        entry = {key: os.fspath(entry)}
    if not isinstance(entry, Mapping):
        raise InputError(f"{where}: it is a {type(entry).__name__}; give a path or an object with {key!r}")
    arguments = {str(k): v for k, v in entry.items()}
    named = arguments.pop("id", None)
    if named is None:
        # A path is a name that says more than a number.
        named = next((arguments[k] for k in (key, "mesh") if isinstance(arguments.get(k), str)), name)
    if named is None or isinstance(named, (Mapping, list)) or str(named) == "":
        raise InputError(f"{where}: it has neither an `id` nor a {key!r}; give one")
    return Item(str(named), folder, arguments)


def output_name(name: str) -> Path:
    """Where the arrays of an item go, below the folder for outputs: its id without what leads out of it.

    The extension of a mesh, an image or a scene goes. What no file name should have becomes `_xx`, its number.
    """
    parts = [part for part in Path(name).parts if part not in ("..", ".", Path(name).anchor)]
    path = Path(*(parts or ["item"]))
    plain = lambda part: "".join(c if c.isalnum() or c in "-. _" else f"_{ord(c):x}" for c in part)
    path = Path(*map(plain, path.parts))
    if path.suffix.lower() in (*MESHES, *IMAGES, *SCENES) and path.stem:
        path = path.with_suffix("")
    return path.with_name(path.name + ".npz")


def digest(item: Item, job: str, settings: Mapping[str, Any]) -> str:
    """SHA-256 of what the result depends on: the job, its arguments, and the content of meshes and arrays they name."""
    sha = hashlib.sha256(job.encode())

    def add(value: Any, key: str = "") -> None:
        if isinstance(value, Mapping):
            sha.update(b"{")
            for k in sorted(value, key=str):
                sha.update(str(k).encode() + b":")
                add(value[k], str(k))
            sha.update(b"}")
        elif isinstance(value, np.ndarray):
            sha.update(f"array{value.dtype.str}{value.shape}".encode())
            sha.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, (list, tuple)):
            sha.update(b"[")
            for v in value:
                add(v)
            sha.update(b"]")
        elif isinstance(value, (str, os.PathLike)):
            text = os.fspath(value)
            sha.update(repr(text).encode())
            if key not in READ and not text.lower().endswith(".npy"):
                sha.update(b";")
                return
            # What cannot be read is told when the item runs.
            with contextlib.suppress(OSError, ValueError), item.path(text).open("rb") as file:
                for block in iter(lambda: file.read(1 << 20), b""):
                    sha.update(block)
        else:
            sha.update(repr(value).encode())
        sha.update(b";")

    add({**settings, **item.arguments})
    return sha.hexdigest()
