"""What changes during a run as the scene prescribes it: gravity, walls that move, fluid that flows in and out."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from annotated_types import Len
from pydantic import model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.parts.box import CORNERS, Box, box_reach
from taichi_rts.scene.validation import FROZEN, NotNegative, Number, Positive, Vector, validated

AXES = ("x", "y", "z")
Axis = Literal["x", "y", "z"]
Face = Literal["x-", "x+", "y-", "y+", "z-", "z+"]


def face_axis(face: str) -> int:
    """Number of the axis that `face` is normal to."""
    return AXES.index(face[0])


def face_position(face: str, domain: Box) -> float:
    """Coordinate [m] of `face` of the domain along its axis."""
    return (domain.lower if face[1] == "-" else domain.upper)[face_axis(face)]


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class GravityChange:
    """Gravity is another from some time on.

    Attributes:
        time: [s], from which on.
        gravity: [m/s^2], (dim,).
    """

    time: Positive
    gravity: Vector


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class MovingWall:
    """A face of the domain that moves along its normal, as a piston, or slides along itself, as a lid or a belt.

    Attributes:
        face: "x-", "x+", "y-" and so on.
        times: [s], (K,), ascending; none: it stays in its plane.
        displacements: of the face along its axis [m], (K,), piecewise linear in time; 0 before the first time, which the
            first displacement must be, and constant after the last. It never leaves the domain, so it is never negative
            for "x-" and never positive for "x+".
        velocity: of the face along itself [m/s], (dim,), all the time; 0 across it. Fluid follows by friction alone, so it takes
            a `kinematic_viscosity`. None: it does not slide.
    """

    face: Face
    times: Annotated[tuple[NotNegative, ...], Len(2)] = ()
    displacements: Annotated[tuple[Number, ...], Len(2)] = ()
    velocity: Vector | None = None

    @model_validator(mode="after")
    def _check(self) -> MovingWall:
        if not self.times and not self.displacements:
            if self.velocity is None:
                raise ValueError("moves nothing; give times [s] and displacements [m], or velocity [m/s]")
            object.__setattr__(self, "times", (0.0, 1.0))
            object.__setattr__(self, "displacements", (0.0, 0.0))
        inward = 1.0 if self.face[1] == "-" else -1.0
        if len(self.times) != len(self.displacements):
            raise ValueError(
                f"times has {len(self.times)} entries, displacements {len(self.displacements)}; give as many"
            )
        if any(a >= b for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ValueError(f"times {self.times} must ascend")
        if self.displacements[0] != 0.0:
            raise ValueError(
                f"displacements {self.displacements} must begin with 0, where the face stands in the domain"
            )
        if any(inward * d < 0.0 for d in self.displacements):
            raise ValueError(
                f"displacements {self.displacements} take face {self.face!r} out of the domain; enlarge the domain"
            )
        axis = face_axis(self.face)
        if self.velocity is not None and axis < len(self.velocity) and self.velocity[axis] != 0.0:
            raise ValueError(
                f"velocity {self.velocity} leads across face {self.face!r}, and must be 0 along {AXES[axis]}, as the face slides "
                "along itself; move it along its normal with times and displacements"
            )
        return self

    @property
    def velocities(self) -> tuple[float, ...]:
        """Velocities [m/s], (K-1,), between the times."""
        return tuple((np.diff(self.displacements) / np.diff(self.times)).tolist())

    @property
    def top_speed(self) -> float:
        """Largest speed [m/s]."""
        return math.hypot(max(map(abs, self.velocities)), *(self.velocity or ()))

    def displacement(self, time: float) -> float:
        """Displacement [m] at `time` [s]."""
        return float(np.interp(time, self.times, self.displacements))


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Inflow:
    """A patch of a face of the domain through which fluid flows in, as a lattice.

    Attributes:
        lower, upper: corners of the patch [m], (dim,), equal in the component across the face.
        velocity: [m/s], (dim,), which the fluid keeps for one support radius.
        start: [s], from which on it flows.
        stop: [s], until which it flows; None: the scene's end.
    """

    lower: Vector
    upper: Vector
    velocity: Vector
    start: NotNegative = 0.0
    stop: Positive | None = None
    places = CORNERS

    @model_validator(mode="after")
    def _check(self) -> Inflow:
        if not len(self.lower) == len(self.upper) == len(self.velocity):
            raise ValueError("lower, upper and velocity differ in dimension; give all 2 or all 3 components")
        flat = [a == b for a, b in zip(self.lower, self.upper, strict=True)]
        if sum(flat) != 1 or not all(a <= b for a, b in zip(self.lower, self.upper, strict=True)):
            raise ValueError(
                f"patch from {self.lower} to {self.upper} is not flat; let one component be equal, the others ascend"
            )
        if self.velocity[self.axis] == 0.0:
            raise ValueError(
                f"velocity {self.velocity} does not cross the patch; give it a component along {AXES[self.axis]}"
            )
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(f"stop {self.stop} must exceed start {self.start}")
        return self

    @property
    def axis(self) -> int:
        """Number of the axis across the patch."""
        return [a == b for a, b in zip(self.lower, self.upper, strict=True)].index(True)

    @property
    def normal_speed(self) -> float:
        """Speed [m/s] across the patch."""
        return abs(self.velocity[self.axis])

    def reach(self, direction: Vector) -> float:
        """Largest value of direction.x over the patch [m times the unit of `direction`, (dim,)]."""
        return box_reach(self.lower, self.upper, direction)

    @property
    def face(self) -> str:
        """The face of the domain that it has to lie on, to flow inwards."""
        return AXES[self.axis] + ("-" if self.velocity[self.axis] > 0.0 else "+")


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Outlet:
    """A sink: a box in which fluid is taken out of the run.

    It leaves freely: what is still outside sees no fluid in there, so the pressure at the box's faces is 0.

    Attributes:
        lower, upper: two opposite corners of the box [m], (dim,).
    """

    lower: Vector
    upper: Vector
    places = CORNERS

    @model_validator(mode="after")
    def _check(self) -> Outlet:
        if len(self.lower) != len(self.upper):
            raise ValueError("lower and upper differ in dimension; give all 2 or all 3 components")
        if not all(a < b for a, b in zip(self.lower, self.upper, strict=True)):
            raise ValueError(f"box from {self.lower} to {self.upper} has no extent; let every component ascend")
        return self
