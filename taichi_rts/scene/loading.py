"""Scenes by name, from files and from plain data."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any

import pydantic

from taichi_rts.errors import SceneError
from taichi_rts.scene.files.reading import SUFFIXES, read_scene_file
from taichi_rts.scene.fluids.particles import Particles
from taichi_rts.scene.scene import Scene
from taichi_rts.scene.schema import keys_at, schema_of
from taichi_rts.scene.validation import describe

BUILT_IN = Path(__file__).parents[1] / "scenes"


def load_scene(name: str | Path, *, particles: float | str | None = None, **changes: Any) -> Scene:
    """Return a built-in scene by name, or the scene in a file: TOML, the same in JSON, or SPlisHSPlasH's (docs/scene_files.md).

    `particles` (a number, or text such as "1.5M") sets the spacing so that about as many fluid particles result;
    other keywords replace fields of the scene. Raises `SceneError` for an unknown name, an unreadable file, an
    unknown key or an invalid value.
    """
    path = Path(name)
    if path.suffix not in SUFFIXES:
        path = BUILT_IN / f"{name}.toml"
        if not path.is_file():
            known = ", ".join(scene_names())
            raise SceneError(
                f"scene {str(name)!r} is unknown; choose one of {known}, or name a .toml file, or a .json file"
            )
    data = read_scene_file(path)
    if particles is not None:
        if "spacing" in changes:
            raise SceneError(f"particles {particles!r} and spacing {changes['spacing']!r} are both given; give one")
        data["spacing"] = _spacing_for(scene_from(data, str(path)), parse_count(particles))
    return scene_from(data | changes, str(path))


def scene_from(data: dict[str, Any], source: str = "scene") -> Scene:
    """Build a `Scene` from plain data; raises `SceneError` that lists every fault with its path."""
    try:
        return pydantic.TypeAdapter(Scene).validate_python(data)
    except pydantic.ValidationError as error:
        raise SceneError(describe(error, source, keys=functools.partial(keys_at, Scene))) from None


def scene_schema() -> dict[str, Any]:
    """Return the JSON Schema of scene files, with which editors complete and check them."""
    return schema_of(Scene)


def scene_names() -> list[str]:
    """List the names of the built-in scenes."""
    return sorted(path.stem for path in BUILT_IN.glob("*.toml"))


def parse_count(value: float | str) -> int:
    """Read a particle count such as 30000, "30k" or "1.5M"; raises `SceneError`."""
    text = str(value).strip()
    factor = {"k": 1e3, "m": 1e6}.get(text[-1:].lower(), 1.0)
    try:
        count = float(text[:-1] if factor > 1.0 else text) * factor
    except ValueError:
        count = math.nan
    if not 1 <= count < 2**31:
        raise SceneError(f"particles {value!r} is not a count from 1 to {2**31 - 1}; write e.g. 30000, 30k or 1.5M")
    return round(count)


def _spacing_for(scene: Scene, count: int) -> float:
    if any(isinstance(fluid, Particles) for fluid in scene.fluids):
        raise SceneError(f"particles {count} cannot be had where the scene gives them one by one; leave particles out")
    spacing = float((scene.volume / count) ** (1.0 / scene.dim))
    for length, periodic in zip(scene.domain.size, scene.is_periodic, strict=True):
        if periodic:  # which has to be a whole number of spacings
            return length / round(length / spacing)
    return spacing
