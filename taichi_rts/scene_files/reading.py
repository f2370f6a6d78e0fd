"""Scene files of every kind as the plain data that `taichi_rts.scene.scene_from` takes."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from taichi_rts.errors import SceneError
from taichi_rts.scene_files.splishsplash import from_splishsplash, is_splishsplash

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SUFFIXES = (".toml", ".json")


def read_scene_file(path: Path) -> dict[str, Any]:
    """Return the data of a TOML file, or of a JSON file that holds the same (`Scene.to_dict`) or a SPlisHSPlasH scene.

    The scene is called like the file if it has no name. Raises `SceneError`.
    """
    kind = path.suffix[1:].upper()
    try:
        text = path.read_text(encoding="utf-8-sig")
        data = tomllib.loads(text) if kind == "TOML" else json.loads(text)
    except OSError as error:
        raise SceneError(f"scene file {str(path)!r} cannot be read: {error.strerror}; check the path") from None
    except (ValueError, RecursionError) as error:
        raise SceneError(f"scene file {str(path)!r} is not valid {kind}: {error}") from None
    if not isinstance(data, dict):
        raise SceneError(f"scene file {str(path)!r} holds a {type(data).__name__}; a scene is a table of keys")
    if is_splishsplash(data):
        return {"name": path.stem} | from_splishsplash(data, path)
    return with_files_beside({"name": path.stem} | data, path)


def with_files_beside(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return the data of the scene file `path` with the files of its particles and meshes relative to its folder.

    Raises `SceneError` for a file outside that folder.
    """
    folder = path.resolve().parent
    resolved: dict[str, Any] = {}
    for key in ("fluids", "obstacles"):
        parts = data.get(key)
        if not isinstance(parts, list):
            continue
        resolved[key] = []
        for k, part in enumerate(parts):
            if isinstance(part, dict) and isinstance(part.get("file"), str):
                file = (folder / part["file"]).resolve()
                if not file.is_relative_to(folder):
                    raise SceneError(
                        f"{path}: {key}.{k}.file: {part['file']!r} leaves the scene's folder {str(folder)!r}; put it there"
                    )
                part = part | {"file": str(file)}
            resolved[key].append(part)
    return data | resolved
