"""How much of the fluid that a scene asks for its particles hold, and which sizes had to be rounded."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from taichi_rts.scene.fluids.block import Block
from taichi_rts.scene.fluids.particles import Particles
from taichi_rts.scene.rows import Rows, fit_rows, is_multiple
from taichi_rts.scene.scene import Scene
from taichi_rts.scene.validation import Vector

NOTABLE = 5e-4
"""Share of the volume from which a gain or a loss is said."""


@dataclass(frozen=True)
class Filling:
    """What a scene's particles hold at the start, before obstacles take their place.

    Attributes:
        wanted, filled: volume of all fluid [m^3] ([m^2] in two dimensions): that asked for, and that of the particles' cells.
        steps: distances of the rows [m], (dim,).
        rounded: a line for each block whose size is another than that asked for.
    """

    wanted: float
    filled: float
    steps: Vector
    rounded: tuple[str, ...]

    @property
    def gain(self) -> float:
        """Volume gained, negative if lost, as a share of that wanted."""
        return self.filled / self.wanted - 1.0

    def facts(self, spacing: float) -> list[tuple[str, str]]:
        """Name and text of what differs from the scene with its `spacing` [m]; none if nothing does."""
        unit = "m^2" if len(self.steps) == 2 else "m^3"
        found = []
        if any(step != spacing for step in self.steps):
            found.append(("rows", f"{_by(self.steps)} m apart, so that they fit; particles' mass follows"))
        found += [("rounded", line) for line in self.rounded]
        if abs(self.gain) > NOTABLE:
            found.append(("volume", f"{self.filled:.4g} of {self.wanted:.4g} {unit} asked for ({self.gain:+.1%})"))
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self)


def filling(scene: Scene) -> Filling:
    """Return what the particles of `scene` hold at the start."""
    rows = fit_rows(scene)
    filled, rounded = 0.0, []
    for number, (asked, fluid) in enumerate(zip(scene.fluids, rows.fluids, strict=True)):
        filled += _volume(scene, rows, fluid)
        if isinstance(asked, Block):
            size, got = _size(asked), _filled_size(rows, fluid)
            if any(abs(a - b) > 1e-6 * scene.spacing for a, b in zip(size, got, strict=True)):
                rounded.append(f"fluids.{number}: size rounded to {_by(got)} m, from {_by(size)} m")
    return Filling(scene.volume, filled, rows.steps, tuple(rounded))


def _volume(scene: Scene, rows: Rows, fluid: Any) -> float:
    """Volume [m^dim] of the cells of a fluid's particles."""
    if isinstance(fluid, Particles):
        return fluid.volume_at(scene.spacing)
    if isinstance(fluid, Block):
        return math.prod(fluid.rows(rows.steps)) * rows.cell
    return len(fluid.fill(rows.steps, scene.domain)) * rows.cell


def _size(block: Any) -> Vector:
    return tuple(b - a for a, b in zip(block.lower, block.upper, strict=True))


def _filled_size(rows: Rows, block: Any) -> Vector:
    """Size [m], (dim,), of the block that its rows fill."""
    sides = zip(_size(block), rows.steps, block.rows(rows.steps), strict=True)
    return tuple(side if is_multiple(side, step) else count * step for side, step, count in sides)


def _by(lengths: Vector) -> str:
    return " x ".join(f"{length:.4g}" for length in lengths)
