"""Scene files of every kind as the plain data that `taichi_rts.scene.loading.scene_from` takes."""

from __future__ import annotations

import contextlib
import json
import os
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from taichi_rts.errors import SceneError
from taichi_rts.scene.files.gravity_tables import with_gravity_table

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SUFFIXES = (".toml", ".json")
SPLISHSPLASH = {"Configuration", "FluidBlocks", "FluidModels", "RigidBodies"}
"""Keys of which any makes the data of a JSON file a SPlisHSPlasH scene."""
LARGEST_FILE = 1 << 20
"""Bytes that a scene file may have: what is longer belongs into a file of particles or a mesh."""


def read_scene_file(path: Path) -> dict[str, Any]:
    """Return the data of a TOML file, or of a JSON file that holds the same (`Scene.to_dict`) or a SPlisHSPlasH scene.

    The scene is called like the file if it has no name. Raises `SceneError` if it cannot be read, is none, or is longer than
    `LARGEST_FILE`.
    """
    kind = path.suffix[1:].upper()
    try:
        with path.open("rb") as file:
            text = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:  # a zero byte in a path is no OSError
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"scene file {str(path)!r} cannot be read: {reason}; check the path") from None
    if len(text) > LARGEST_FILE:
        raise SceneError(
            f"scene file {str(path)!r} is longer than {LARGEST_FILE} bytes; put particles and meshes into files of their own"
        )
    try:
        decoded = text.decode("utf-8-sig")
        data = tomllib.loads(decoded) if kind == "TOML" else json.loads(decoded)
    except (ValueError, RecursionError) as error:  # whatever the text is that is none
        raise SceneError(f"scene file {str(path)!r} is not valid {kind}: {error}; correct it") from None
    if not isinstance(data, dict):
        raise SceneError(f"scene file {str(path)!r} holds a {type(data).__name__}; a scene is a table of keys")
    name = {"name": name_for(path)}
    if data.keys() & SPLISHSPLASH:
        from taichi_rts.scene.files.splishsplash import from_splishsplash  # only here: its models take long to build

        return name | from_splishsplash(data, path)
    return with_files_beside(name | data, path)


def name_for(path: Path) -> str:
    """Return the name of the scene in a file that gives it none."""
    return re.sub(r"[^\w .()+-]", "_", path.stem)[:100].lstrip(" .") or "scene"


def with_files_beside(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return the data of the scene file `path` with the files of its particles and meshes relative to its folder.

    A table of gravity is read. Raises `SceneError` for a file outside that folder.
    """
    folder = path.resolve().parent

    def inside(place: str, name: str) -> Path:
        file = _resolved(folder, name)
        if file is None or not file.is_relative_to(folder):
            raise SceneError(f"{path}: {place}.file: {name!r} leaves the scene's folder {str(folder)!r}; put it there")
        return file

    table = data.get("gravity_changes")
    if isinstance(table, dict) and isinstance(table.get("file"), str) and len(table) == 1:
        data = with_gravity_table(data, inside("gravity_changes", table["file"]))
    resolved: dict[str, Any] = {}
    for key in ("fluids", "obstacles"):
        parts = data.get(key)
        if not isinstance(parts, list):
            continue
        resolved[key] = []
        for k, part in enumerate(parts):
            if isinstance(part, dict) and isinstance(part.get("file"), str):
                part = part | {"file": str(inside(f"{key}.{k}", part["file"]))}
            resolved[key].append(part)
    return data | resolved


def parts_with_files(data: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the place, such as "obstacles.0", and the data of each part of a scene that a file gives."""
    for key in ("fluids", "obstacles"):
        for k, part in enumerate(data.get(key, ())):
            if isinstance(part, dict) and isinstance(part.get("file"), str):
                yield f"{key}.{k}", part


def places_beside(data: Mapping[str, Any], folder: Path) -> dict[str, str]:
    """Return where each file of a scene lies as seen from `folder`, by its path, so that all may move together."""
    places = {}
    for _, part in parts_with_files(data):
        with contextlib.suppress(ValueError):  # on another drive
            places[part["file"]] = Path(os.path.relpath(os.path.abspath(part["file"]), folder.absolute())).as_posix()
    return places


def moved_along(data: dict[str, Any], places: Mapping[str, str], folder: Path) -> None:
    """Replace in a scene's data each path of a file by that of the file in the same `places` beside `folder`."""
    for _, part in parts_with_files(data):
        beside = _resolved(folder.absolute(), str(places.get(part["file"], "")))
        if beside is not None and part["file"] in places and (beside.is_file() or not os.path.isfile(part["file"])):
            part["file"] = str(beside)


def require_files_near(data: dict[str, Any], path: Path, source: str) -> None:
    """Raise `SceneError` if the scene in the checkpoint `path` names a file that lies neither here nor near the checkpoint.

    Here is the present folder and all below it; near is all below the folder that the run's own lies in.
    """
    folders = (Path.cwd(), path.resolve().parent.parent.parent)
    for place, part in parts_with_files(data):
        file = _resolved(Path.cwd(), part["file"])
        if file is None or not any(file.is_relative_to(folder) for folder in folders):
            raise SceneError(
                f"{source}: {place}.file: {part['file']!r} is neither below {folders[0]} nor below {folders[1]}; "
                "if it is yours, go on in its folder"
            )


def _resolved(folder: Path, file: str) -> Path | None:
    """Return the path of `file` in `folder`, with links followed; None if there can be none of that name."""
    try:
        return (folder / file).resolve()
    except (OSError, ValueError, RuntimeError):  # a zero byte, or links in a circle
        return None
