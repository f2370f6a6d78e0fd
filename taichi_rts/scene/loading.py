"""Scenes by name, from files and from plain data."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any

import pydantic

from taichi_rts.errors import SceneError
from taichi_rts.scene.files.reading import SUFFIXES, read_scene_file
from taichi_rts.scene.fluids.block import Block
from taichi_rts.scene.fluids.particles import Particles
from taichi_rts.scene.rows import fit_rows
from taichi_rts.scene.scene import Scene
from taichi_rts.scene.schema import keys_at, schema_of
from taichi_rts.scene.validation import describe

NEAR = 0.06
"""How far a spacing that divides a scene's lengths may lie from the one that a count of particles asks for, as a share of it."""
OFF = 0.04
"""Share by which the number of particles may then be another."""
BUILT_IN = Path(__file__).parents[1] / "scenes"


def load_scene(name: str | Path, *, particles: float | str | None = None, **changes: Any) -> Scene:
    """Return a built-in scene by name, or the scene in a file: TOML, the same in JSON, or SPlisHSPlasH's (docs/scene_files.md).

    `particles` (a number, or text such as "1.5M") sets the spacing so that about as many fluid particles result,
    within some per cent such that whole rows of them fit;
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
    return _divisor_near(scene, spacing, count)


def _divisor_near(scene: Scene, spacing: float, count: int) -> float:
    """Return the spacing [m] near `spacing` that suits the scene's lengths best and gives about `count` particles.

    Those that divide a side of a block or of the domain are tried. The best gains or loses least volume, and needs rows that are
    least further apart, or closer (`rows.fit_rows`).
    """
    lengths = {*scene.domain.size}
    for fluid in scene.fluids:
        lengths |= {b - a for a, b in zip(fluid.lower, fluid.upper, strict=True)}
    most = min((fluid.extent[1] for fluid in scene.fluids if fluid.extent), default=math.inf)
    tried = {length / number for length in lengths for number in _counts_near(length / spacing)}
    near = [s for s in sorted(tried) if abs(s / spacing - 1.0) <= NEAR and s <= most * (1.0 + 1e-9)]

    def cost(s: float) -> tuple[bool, float, float]:
        rows = fit_rows(scene, s)
        found = sum(
            math.prod(fluid.rows(rows.steps)) if isinstance(fluid, Block) else fluid.volume_at(s) / rows.cell
            for fluid in rows.fluids
        )
        off = abs(found / count - 1.0)
        stretched = max(abs(step / s - 1.0) for step in rows.steps)
        lost = abs(found * rows.cell / scene.volume - 1.0)
        return off > OFF, round(off if off > OFF else lost + stretched, 6), abs(s - spacing)

    return min([spacing, *near], key=cost)


def _counts_near(count: float) -> tuple[int, int]:
    return max(1, math.floor(count)), math.ceil(count)
