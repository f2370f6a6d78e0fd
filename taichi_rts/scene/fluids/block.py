"""Blocks of fluid."""

from __future__ import annotations

import math

import numpy as np
from pydantic import model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.fluids.shape import FluidShape, check_velocity, lattice
from taichi_rts.scene.parts.box import CORNERS, Box, box_reach, check_corners
from taichi_rts.scene.parts.velocities import Velocity
from taichi_rts.scene.validation import FROZEN, Colour, NotNegative, Vector, validated


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Block(FluidShape):
    """A block of fluid between two corners.

    Attributes:
        lower, upper: the corners [m], (dim,).
        velocity: [m/s] at the start: a vector (dim,) or a field of `velocities.py`; None: at rest.
        kinematic_viscosity: nu [m^2/s]; None: the scene's.
        colour: in pictures by fluid, "orange" or "#RRGGBB"; None: the palette's.
    """

    lower: Vector
    upper: Vector
    velocity: Velocity | None = None
    kinematic_viscosity: NotNegative | None = None
    colour: Colour | None = None
    places = CORNERS
    keeps_inside = True

    @model_validator(mode="after")
    def _check(self) -> Block:
        check_corners(self.lower, self.upper)
        check_velocity(self.velocity, len(self.lower), "block")
        return self

    @property
    def volume(self) -> float:
        """Volume [m^3] (area [m^2] in two dimensions)."""
        return math.prod(b - a for a, b in zip(self.lower, self.upper, strict=True))

    @property
    def outline(self) -> str:
        """Where it is, for messages."""
        return f"block from {self.lower} to {self.upper}"

    def reach(self, direction: Vector) -> float:
        """Largest value of direction.x over the block [m times the unit of `direction`, (dim,)]."""
        return box_reach(self.lower, self.upper, direction)

    @property
    def extent(self) -> tuple[str, float]:
        """Its shortest edge [m]."""
        return "shortest edge", min(b - a for a, b in zip(self.lower, self.upper, strict=True))

    def volume_at(self, spacing: float) -> float:
        """Its volume, whatever the spacing."""
        return self.volume

    def contains(self, x: np.ndarray) -> np.ndarray:
        """All of its bounding box."""
        return np.ones(len(x), bool)

    def separation(self, other: Block) -> float:
        """Largest gap [m] along an axis, negative if the blocks overlap."""
        sides = zip(self.lower, self.upper, other.lower, other.upper, strict=True)
        return max(max(c - b, a - d) for a, b, c, d in sides)

    def rows(self, steps: Vector) -> tuple[int, ...]:
        """How many rows `steps` [m] apart fit into it, (dim,), at least one."""
        sides = zip(self.lower, self.upper, steps, strict=True)
        return tuple(max(1, math.floor((b - a) / step * (1 + 1e-9) + 1e-6)) for a, b, step in sides)

    def fill(self, steps: Vector, domain: Box) -> np.ndarray:
        """Positions [m], (N, dim), of a lattice of `steps` [m], (dim,), whose cells all lie inside the block.

        A size that is no multiple of the steps, as `rows.fit_rows` makes it, leaves a gap of less than one, never an overlap: the
        lattice sits at the face that touches a wall of the domain (the lower one if both or none do), so that it rests there.
        """
        axes = []
        for a, b, low, high, step, count in zip(
            self.lower, self.upper, domain.lower, domain.upper, steps, self.rows(steps), strict=True
        ):
            tolerance = 1e-6 * step
            at_upper_wall = abs(b - high) < tolerance and abs(a - low) >= tolerance
            start = b - count * step if at_upper_wall else a
            axes.append(start + (np.arange(count) + 0.5) * step)
        return lattice(axes)
