"""Spheres and discs of fluid."""

from __future__ import annotations

import math

import numpy as np
from pydantic import model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.fluids.block import Block
from taichi_rts.scene.fluids.shape import FluidShape, check_velocity, lattice
from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.parts.velocities import Velocity
from taichi_rts.scene.validation import FROZEN, Colour, NotNegative, Positive, Vector, validated


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Sphere(FluidShape):
    """A sphere of fluid, in two dimensions a disc.

    Attributes:
        centre: [m], (dim,).
        radius: [m].
        velocity: [m/s] at the start: a vector (dim,) or a field of `velocities.py`; None: at rest.
        kinematic_viscosity: nu [m^2/s]; None: the scene's.
        colour: in pictures by fluid, "orange" or "#RRGGBB"; None: the palette's.
    """

    centre: Vector
    radius: Positive
    velocity: Velocity | None = None
    kinematic_viscosity: NotNegative | None = None
    colour: Colour | None = None
    places = ("centre",)
    telling = frozenset({"centre", "radius"})

    @model_validator(mode="after")
    def _check(self) -> Sphere:
        check_velocity(self.velocity, len(self.centre), "sphere")
        return self

    @property
    def lower(self) -> Vector:
        """Lower corner [m], (dim,), of the bounding box."""
        return tuple(x - self.radius for x in self.centre)

    @property
    def upper(self) -> Vector:
        """Upper corner [m], (dim,), of the bounding box."""
        return tuple(x + self.radius for x in self.centre)

    @property
    def volume(self) -> float:
        """Volume [m^3] (area [m^2] in two dimensions)."""
        return math.pi * self.radius**2 if len(self.centre) == 2 else 4.0 / 3.0 * math.pi * self.radius**3

    @property
    def outline(self) -> str:
        """Where it is, for messages."""
        return f"sphere of radius {self.radius} around {self.centre}"

    def reach(self, direction: Vector) -> float:
        """Largest value of direction.x over the sphere [m times the unit of `direction`, (dim,)]."""
        return sum(d * x for d, x in zip(direction, self.centre, strict=True)) + self.radius * math.hypot(*direction)

    @property
    def extent(self) -> tuple[str, float]:
        """Its radius [m]."""
        return "radius", self.radius

    def volume_at(self, spacing: float) -> float:
        """Its volume, whatever the spacing."""
        return self.volume

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Points, (N, dim), within the radius, (N,)."""
        return np.linalg.norm(x - np.array(self.centre), axis=1) <= self.radius

    def separation(self, other: Block | Sphere) -> float:
        """Distance [m] of the surfaces of two spheres, or from a block; negative if the two overlap."""
        if isinstance(other, Sphere):
            return math.dist(self.centre, other.centre) - self.radius - other.radius
        nearest = [min(max(x, a), b) for x, a, b in zip(self.centre, other.lower, other.upper, strict=True)]
        return math.dist(self.centre, nearest) - self.radius

    def fill(self, steps: Vector, domain: Box) -> np.ndarray:
        """Positions [m], (N, dim), of a lattice of `steps` [m], (dim,), that lie inside the sphere.

        The lattice's cells meet at the centre, so it has the centre's mirror symmetries. A cell counts whole if its middle is
        inside, so the surface is a staircase, but N cells are the volume to within a few cells.
        """
        counts = [math.ceil(self.radius / step) for step in steps]
        offsets = lattice([(np.arange(-n, n) + 0.5) * step for n, step in zip(counts, steps, strict=True)])
        inside = np.linalg.norm(offsets, axis=1) <= self.radius * (1 + 1e-9)
        return np.asarray(self.centre) + offsets[inside]
