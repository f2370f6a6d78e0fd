"""Where fluid is at the start and how it moves there: boxes, blocks and spheres."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator, Tag, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.parts.particles import Particles
from taichi_rts.scene.parts.velocities import Field, Velocity
from taichi_rts.scene.validation import FROZEN, Colour, NotNegative, Positive, Vector, validated


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Box:
    """An axis-aligned box between two corners: `lower` and `upper` [m], (dim,) each."""

    lower: Vector
    upper: Vector

    @model_validator(mode="after")
    def _check(self) -> Box:
        _check_corners(self.lower, self.upper)
        return self

    @property
    def size(self) -> tuple[float, ...]:
        """Edge lengths [m], (dim,)."""
        return tuple(b - a for a, b in zip(self.lower, self.upper, strict=True))

    def reach(self, direction: Vector) -> float:
        """Largest value of direction.x over the box [m times the unit of `direction`, (dim,)]."""
        return box_reach(self.lower, self.upper, direction)


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Block:
    """A block of fluid between two corners `lower` and `upper` [m], (dim,).

    It moves at `velocity` [m/s]: a vector (dim,) or a field of `velocities.py`; None: at rest. `kinematic_viscosity` is
    its nu [m^2/s]; None: the scene's. `colour` is its colour in pictures by fluid, "orange" or "#RRGGBB"; None: the palette's.
    """

    lower: Vector
    upper: Vector
    velocity: Velocity | None = None
    kinematic_viscosity: NotNegative | None = None
    colour: Colour | None = None

    @model_validator(mode="after")
    def _check(self) -> Block:
        _check_corners(self.lower, self.upper)
        _check_velocity(self.velocity, len(self.lower), "block")
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


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Sphere:
    """A sphere of fluid, in two dimensions a disc, around `centre` [m], (dim,), with `radius` [m].

    It moves at `velocity` [m/s]: a vector (dim,) or a field of `velocities.py`; None: at rest. `kinematic_viscosity` is
    its nu [m^2/s]; None: the scene's. `colour` is its colour in pictures by fluid, "orange" or "#RRGGBB"; None: the palette's.
    """

    centre: Vector
    radius: Positive
    velocity: Velocity | None = None
    kinematic_viscosity: NotNegative | None = None
    colour: Colour | None = None

    @model_validator(mode="after")
    def _check(self) -> Sphere:
        _check_velocity(self.velocity, len(self.centre), "sphere")
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


def _fluid_tag(data: Any) -> str:
    keys = data.keys() if isinstance(data, dict) else set()
    if isinstance(data, Particles) or {"positions", "velocities", "file", "sha256"} & keys:
        return "<particles>"
    return "<sphere>" if isinstance(data, Sphere) or {"centre", "radius"} & keys else "<block>"


Fluid = Annotated[
    Annotated[Block, Tag("<block>")] | Annotated[Sphere, Tag("<sphere>")] | Annotated[Particles, Tag("<particles>")],
    Discriminator(_fluid_tag),
]
"""A block, a sphere if it has a centre or a radius, or particles: a mistake in one is not reported for the others as well."""


def velocities(fluid: Block | Sphere | Particles, x: np.ndarray) -> np.ndarray:
    """Velocities [m/s], (N, dim), of a fluid's particles at `x` [m], (N, dim)."""
    if isinstance(fluid, Particles):
        return np.zeros_like(x) if fluid.velocities is None else fluid.velocities
    if isinstance(fluid.velocity, Field):
        return fluid.velocity.at(x)
    return np.tile(np.asarray(fluid.velocity or (0.0,) * x.shape[1]), (len(x), 1))


def top_speed(fluid: Block | Sphere | Particles) -> float:
    """Largest speed [m/s] in a fluid's bounding box."""
    if isinstance(fluid, Particles):
        return fluid.top_speed
    if isinstance(fluid.velocity, Field):
        return fluid.velocity.top_speed(np.array(corners(fluid)))
    return math.hypot(*(fluid.velocity or (0.0,)))


def box_reach(lower: Vector, upper: Vector, direction: Vector) -> float:
    """Largest value of direction.x over the box from `lower` to `upper` [m], which may be flat; `direction` is (dim,)."""
    return sum(max(d * a, d * b) for d, a, b in zip(direction, lower, upper, strict=True))


def corners(shape: Box | Block | Sphere | Particles) -> list[Vector]:
    """Corners [m] of the bounding box, 2^dim of (dim,)."""
    found: list[Vector] = [()]
    for a, b in zip(shape.lower, shape.upper, strict=True):
        found = [(*corner, x) for corner in found for x in (a, b)]
    return found


def separation(one: Block | Sphere | Particles, two: Block | Sphere | Particles) -> float:
    """A length [m] that is negative if the two overlap; if one is a sphere, the distance of what does not."""
    if isinstance(one, Particles):
        return one.separation(two)
    if isinstance(two, Particles):
        return two.separation(one)
    if isinstance(one, Block) and isinstance(two, Block):
        sides = zip(one.lower, one.upper, two.lower, two.upper, strict=True)
        return max(max(c - b, a - d) for a, b, c, d in sides)
    if isinstance(one, Sphere) and isinstance(two, Sphere):
        return math.dist(one.centre, two.centre) - one.radius - two.radius
    sphere, block = (one, two) if isinstance(one, Sphere) else (two, one)
    assert isinstance(sphere, Sphere)  # for mypy
    nearest = [min(max(x, a), b) for x, a, b in zip(sphere.centre, block.lower, block.upper, strict=True)]
    return math.dist(sphere.centre, nearest) - sphere.radius


def _check_corners(lower: Vector, upper: Vector) -> None:
    if len(lower) != len(upper):
        raise ValueError(f"lower {lower} and upper {upper} differ in dimension; give both 2 or both 3 components")
    if not all(a < b for a, b in zip(lower, upper, strict=True)):
        raise ValueError(f"upper {upper} must exceed lower {lower} in every component")


def _check_velocity(velocity: Vector | Field | None, dim: int, kind: str) -> None:
    if velocity is None:
        return
    size, text = (velocity.dim, "field") if isinstance(velocity, Field) else (len(velocity), str(velocity))
    if size != dim:
        raise ValueError(f"velocity {text} has {size} components; the {kind} has {dim}")
