"""What a job makes of an item, within the process that it has."""

from __future__ import annotations

import inspect
import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import proxel

from .._core import InputError
from .._info import Info
from .._meshfile import read_mesh
from ._items import Item, output_name

#: What a job takes of a mesh, and what its result is called.
MESH_JOBS = {
    "unwrap": ("F", "uv"),
    "deform": ("T", "X"),
    "planarize": ("F", "X"),
    "wire": ("F", "X"),
    "shape": ("F", "X"),
    "geodesic": ("F", "distance"),
}
IMAGE_JOBS = {"deblur": "image", "denoise": "image", "inpaint": "image", "wavefront": "phi"}
JOBS = (*MESH_JOBS, *IMAGE_JOBS, "simulate")

#: Arguments that may be the paths of files which the job itself reads.
FILES = ("recipe", "scene", "pins")
#: Arrays of the info that are kept with the result.
KEPT = ("uv_faces", "faces", "reaction")


class Job(NamedTuple):
    """What is done to every item: a name, or a function of a module."""

    name: str
    module: str | None = None  # of a function
    main: str | None = None  # the script that it is of, where that is the program itself


def job_of(job: str | Callable[[Item], Any]) -> Job:
    """A job by its name, or as a function that another process can find."""
    if isinstance(job, str):
        if job not in JOBS:
            raise InputError(f"job is {job!r}; known are {', '.join(sorted(JOBS))}, or give a function")
        return Job(job)
    name, module = getattr(job, "__qualname__", ""), getattr(job, "__module__", None)
    if not module or not name.isidentifier():
        raise InputError(
            f"job is {job!r}; give a function at the top level of a module, for other processes to find it"
        )
    if module != "__main__":
        return Job(name, module)
    import __main__

    main = getattr(__main__, "__file__", None)
    if main is None:
        raise InputError(f"job is {name!r} of an interactive session; put it into a module, for others to find it")
    return Job(name, module, str(Path(main).resolve()))


def has_time_limit(job: Job) -> bool:
    """Whether the job itself stops at a time limit, with the best so far."""
    return job.module is None


def execute(
    item: Item, job: Job, settings: Mapping[str, Any], function: Callable[[Item], Any] | None, out: str, preview: bool
) -> dict[str, Any]:
    """Does it: writes OUT/id.npz and returns `status`, `reason`, `report` and `out` of the record."""
    if function is not None:
        report, arrays = _split(function(item._replace(arguments={**settings, **item.arguments})))
        info = None
    else:
        info, arrays = run_job(job.name, item, settings)
        report = {k: v for k, v in info.to_dict().items() if k != "settings"}
    status = str(report.get("status", "done"))
    saved = None
    if arrays:
        saved = output_name(item.id).as_posix()
        _save(Path(out, saved), arrays)
    if preview and info is not None:
        _picture(info, Path(out, saved or "item").with_suffix(".png"))
    return {"status": status, "reason": str(report.get("reason", "")), "out": saved, "report": finite(report)}


def run_job(name: str, item: Item, settings: Mapping[str, Any]) -> tuple[Info, dict[str, Any]]:
    """One of the package's functions on an item: its info, and the arrays to keep.

    `mesh` is read, strings that end in .npy are read as arrays, and paths begin in the item's folder.
    """
    given: dict[str, Any] = {k: _value(item, k, v) for k, v in {**settings, **item.arguments}.items()}
    if name == "simulate":
        frames = proxel.simulate(given.pop("scene", None) or _missing(item, "scene"), **given)
        for _ in frames:
            pass
        return frames.info, dict(frames.simulator.frame.positions)
    function = getattr(proxel, name)
    if name in MESH_JOBS:
        key, result = MESH_JOBS[name]
        if "mesh" in given:
            mesh = read_mesh(given.pop("mesh"))
            elements = mesh.T if key == "T" and mesh.T is not None else mesh.F
            given = {"V": mesh.V, key: elements, **given}
    else:
        result = IMAGE_JOBS[name]
    parameters = inspect.signature(function).parameters.values()
    for p in parameters:
        if p.default is p.empty and p.kind is p.POSITIONAL_OR_KEYWORD and given.get(p.name) is None:
            _missing(item, p.name)
    array, info = function(**given)
    more = {k: getattr(info, k) for k in KEPT if getattr(info, k, None) is not None}
    return info, {result: array, **{k: v for k, v in more.items() if isinstance(v, np.ndarray)}}


def _missing(item: Item, name: str) -> Any:
    raise InputError(f"{item.id}: it has no `{name}`; give it in the item or in the settings of all")


def _value(item: Item, key: str, value: Any) -> Any:
    if isinstance(value, str):
        if key == "mesh":
            return item.path(value)
        if value.lower().endswith(".npy"):
            try:
                return np.load(item.path(value), allow_pickle=False)
            except (OSError, ValueError) as e:
                raise InputError(f"{item.path(value)}: {e}; give an array that numpy.save has written") from e
        if key in FILES:
            return item.path(value)
    return value


def _split(answer: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a function returned as a report and arrays."""
    if answer is None:
        return {}, {}
    if isinstance(answer, Info):
        return {k: v for k, v in answer.to_dict().items() if k != "settings"}, {}
    if not isinstance(answer, Mapping):
        raise TypeError(
            f"the function returned a {type(answer).__name__}; return a dict of arrays and numbers, or None"
        )
    arrays = {str(k): v for k, v in answer.items() if isinstance(v, np.ndarray)}
    return {str(k): v for k, v in answer.items() if str(k) not in arrays}, arrays


def finite(value: Any) -> Any:
    """As JSON can have it: null for numbers that are none, texts for what is no number."""
    if isinstance(value, Mapping):
        return {str(k): finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return finite(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return json.loads(value.to_json()) if isinstance(value, Info) else str(value)


def _save(path: Path, arrays: Mapping[str, Any]) -> None:
    """Whole or not at all, whoever else writes the same: results are the same bits."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        with partial.open("wb") as file:
            np.savez(file, **arrays)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def _picture(info: Info, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.stem}.{os.getpid()}.partial.png")
    try:
        info.save_preview(partial)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
