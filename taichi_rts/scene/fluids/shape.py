"""What all shapes of fluid have in common."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from taichi_rts.scene.parts.box import Box, corners
from taichi_rts.scene.parts.velocities import Field, Velocity
from taichi_rts.scene.validation import Vector


class FluidShape:
    """A shape of fluid. Each one has a file of its own and a place in the list `shapes.FLUID_SHAPES`.

    Attributes:
        lower, upper: corners [m], (dim,), of the bounding box.
        velocity: [m/s], (dim,), or a field; None: at rest.
        kinematic_viscosity: nu [m^2/s]; None: the scene's.
        colour: in pictures by fluid; None: the palette's.
        places: those of its fields that are coordinates (see `placing.translated`).
        telling: keys of a scene file by which it is known; the first shape of the list has none.
        keeps_inside: whether its particles stay half a spacing inside of it, as those of a lattice in a block do.
    """

    lower: Any
    upper: Any
    velocity: Velocity | None
    kinematic_viscosity: float | None
    colour: str | None
    places: ClassVar[tuple[str, ...]] = ()
    telling: ClassVar[frozenset[str]] = frozenset()
    keeps_inside: ClassVar[bool] = False

    @property
    def outline(self) -> str:
        """Where it is, for messages."""
        raise NotImplementedError

    @property
    def extent(self) -> tuple[str, float] | None:
        """Name and size [m] of the length that the spacing must not exceed; None if there is none."""
        raise NotImplementedError

    def volume_at(self, spacing: float) -> float:
        """Volume [m^3] (area [m^2] in two dimensions) of it in a scene of `spacing` [m]."""
        raise NotImplementedError

    def reach(self, direction: Vector) -> float:
        """Largest value of direction.x over it [m times the unit of `direction`, (dim,)]."""
        raise NotImplementedError

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Which points `x` [m], (N, dim), of its bounding box lie in it, (N,) booleans."""
        raise NotImplementedError

    def separation(self, other: Any) -> float:
        """Distance [m] from `other`, which is of its own kind or of an earlier one of the list; negative if the two overlap.

        Where one of the two `keeps_inside`, any length with the right sign will do.
        """
        raise NotImplementedError

    def fill(self, steps: Vector, domain: Box) -> np.ndarray:
        """Positions [m], (N, dim), of its particles in a scene whose rows are `steps` [m], (dim,), apart (`rows.fit_rows`)."""
        raise NotImplementedError

    def velocities_at(self, x: np.ndarray) -> np.ndarray:
        """Velocities [m/s], (N, dim), of its particles at `x` [m], (N, dim)."""
        if isinstance(self.velocity, Field):
            return self.velocity.at(x)
        return np.tile(np.asarray(self.velocity or (0.0,) * x.shape[1]), (len(x), 1))

    @property
    def top_speed(self) -> float:
        """Largest speed [m/s] in its bounding box."""
        if isinstance(self.velocity, Field):
            return self.velocity.top_speed(np.array(corners(self)))
        return math.hypot(*(self.velocity or (0.0,)))


def lattice(axes: list[np.ndarray]) -> np.ndarray:
    """All combinations of the axes' values, (N, dim), the last axis fastest."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def check_velocity(velocity: Vector | Field | None, dim: int, kind: str) -> None:
    """Raise `ValueError` unless a velocity of a `kind` of fluid has its number of components."""
    if velocity is None:
        return
    size, text = (velocity.dim, "field") if isinstance(velocity, Field) else (len(velocity), str(velocity))
    if size != dim:
        raise ValueError(f"velocity {text} has {size} components; the {kind} has {dim}")
