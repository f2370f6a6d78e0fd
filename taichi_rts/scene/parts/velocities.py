"""Vector fields in space that scenes are made of: initial velocities and a body force."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Len
from pydantic import Discriminator, Tag, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.validation import FROZEN, Number, Positive, Vector, validated

Plane = Annotated[tuple[Number, ...], Len(2, 2)]
"""A place in two dimensions."""


class Field:
    """What the fields have in common."""

    @property
    def dim(self) -> int:
        """Number of space dimensions, 2 or 3."""
        raise NotImplementedError

    def at(self, x: np.ndarray) -> np.ndarray:
        """Values (..., dim) at positions `x` [m], (..., dim)."""
        raise NotImplementedError

    def top_speed(self, corners: np.ndarray) -> float:
        """Bound of the norm in a box with `corners` [m], (2^dim, dim)."""
        raise NotImplementedError


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class LinearField(Field):
    """The vector field value + gradient . (x - origin).

    Attributes:
        gradient: derivative of component d along e in row d and column e [1/s for a velocity, 1/s^2 for an acceleration].
        value: the field at `origin`, (dim,); None: 0.
        origin: [m], (dim,); None: 0.
    """

    gradient: Annotated[tuple[Vector, ...], Len(2, 3)]
    value: Vector | None = None
    origin: Vector | None = None
    places = ("origin",)

    @model_validator(mode="after")
    def _check(self) -> LinearField:
        faults = [
            f"gradient: row {k} has {len(row)} components; {self.dim} rows need {self.dim}"
            for k, row in enumerate(self.gradient)
            if len(row) != self.dim
        ]
        for name, vector in (("value", self.value), ("origin", self.origin)):
            if vector is not None and len(vector) != self.dim:
                faults.append(f"{name} {vector} has {len(vector)} components; the gradient has {self.dim}")
        if faults:
            raise ValueError("\n  ".join(faults))
        return self

    @property
    def dim(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return len(self.gradient)

    @property
    def base(self) -> tuple[Vector, Vector]:
        """`origin` and `value`, (dim,) each, with the defaults filled in."""
        zero = (0.0,) * self.dim
        return self.origin or zero, self.value or zero

    def base_near(self, lower: Vector, upper: Vector) -> tuple[Vector, Vector]:
        """`base`, or where `origin` is far from the box between `lower` and `upper` [m], the point 0 and the field there.

        Far is farther than the box's longest side: single precision would round what little x - origin changes in the box.
        """
        origin, value = self.base
        reach = max(b - a for a, b in zip(lower, upper, strict=True))
        if all(a - reach <= x <= b + reach for a, x, b in zip(lower, origin, upper, strict=True)):
            return origin, value
        return (0.0,) * self.dim, tuple(self.at(np.zeros(self.dim)).tolist())

    @property
    def is_conservative(self) -> bool:
        """Whether the field has a potential: its gradient is symmetric."""
        gradient = np.array(self.gradient)
        return bool(np.abs(gradient - gradient.T).max() <= 1e-9 * np.abs(gradient).max())

    def at(self, x: np.ndarray) -> np.ndarray:
        """Values (..., dim) at positions `x` [m], (..., dim)."""
        origin, value = self.base
        return np.asarray(value) + (np.asarray(x) - origin) @ np.array(self.gradient).T

    def potential(self, x: np.ndarray) -> np.ndarray:
        """-(value.y + y.gradient.y / 2), (...), at positions `x` [m], (..., dim), y = x - origin: the field is -grad of it."""
        origin, value = self.base
        y = np.asarray(x) - origin
        return -(y @ np.asarray(value) + 0.5 * (y @ np.array(self.gradient) * y).sum(axis=-1))

    def top_speed(self, corners: np.ndarray) -> float:
        """Largest norm in a box with `corners` [m], (2^dim, dim): the norm is convex, so it is that of a corner."""
        return float(np.linalg.norm(self.at(corners), axis=1).max())


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class TaylorGreen(Field):
    """A square lattice of vortices in two dimensions: u = U (-cos kx sin ky, sin kx cos ky), k = 2 pi / wavelength.

    An exact solution of the Navier-Stokes equations on periodic axes: it decays as exp(-2 nu k^2 t) (Taylor & Green 1937).

    Attributes:
        speed: U [m/s], the largest speed.
        wavelength: [m], of two vortices side by side; a periodic axis holds a whole number of it.
        origin: [m], (2,), where x = y = 0; None: the scene's.
    """

    speed: Positive
    wavelength: Positive
    origin: Plane | None = None
    places = ("origin",)

    @property
    def dim(self) -> int:
        """Two."""
        return 2

    def at(self, x: np.ndarray) -> np.ndarray:
        """Velocities [m/s], (..., 2), at positions `x` [m], (..., 2)."""
        kx, ky = np.moveaxis(2.0 * math.pi / self.wavelength * _from(self.origin, x), -1, 0)
        return self.speed * np.stack([-np.cos(kx) * np.sin(ky), np.sin(kx) * np.cos(ky)], axis=-1)

    def top_speed(self, corners: np.ndarray) -> float:
        """U [m/s]."""
        return self.speed


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class StandingWave(Field):
    """The velocity of a standing gravity wave in two dimensions while its surface is flat (linear theory; Lamb 1932, art. 228).

    u = U (-sin kx cosh ky, cos kx sinh ky) / sinh kH, k = 2 pi / wavelength, over a floor at y = 0. It oscillates with
    omega^2 = g k tanh kH; the surface rises by U/omega sin(omega t) cos kx. Walls may stand at multiples of half a wavelength.

    Attributes:
        speed: U [m/s], the largest vertical speed of the surface.
        wavelength: [m].
        depth: H [m].
        origin: [m], (2,), where x = y = 0: on the floor, under a crest or a trough; None: the scene's.
    """

    speed: Positive
    wavelength: Positive
    depth: Positive
    origin: Plane | None = None
    places = ("origin",)

    @property
    def dim(self) -> int:
        """Two."""
        return 2

    @property
    def wavenumber(self) -> float:
        """K [1/m]."""
        return 2.0 * math.pi / self.wavelength

    def at(self, x: np.ndarray) -> np.ndarray:
        """Velocities [m/s], (..., 2), at positions `x` [m], (..., 2)."""
        kx, ky = np.moveaxis(self.wavenumber * _from(self.origin, x), -1, 0)
        scale = self.speed / math.sinh(self.wavenumber * self.depth)
        return scale * np.stack([-np.sin(kx) * np.cosh(ky), np.cos(kx) * np.sinh(ky)], axis=-1)

    def top_speed(self, corners: np.ndarray) -> float:
        """Speed [m/s] at the surface where it is largest."""
        return self.speed / math.tanh(self.wavenumber * self.depth)


def _from(origin: Vector | None, x: np.ndarray) -> np.ndarray:
    """Positions `x` [m], (..., 2), seen from `origin`."""
    return np.asarray(x) if origin is None else np.asarray(x) - origin


def _velocity_tag(data: Any) -> str:
    """Name the kind of velocity by the keys it has, so that a mistake in one is not reported for the others as well."""
    if isinstance(data, LinearField) or (isinstance(data, dict) and not {"speed", "wavelength"} & data.keys()):
        return "<LinearField>"
    if isinstance(data, StandingWave) or (isinstance(data, dict) and "depth" in data):
        return "<StandingWave>"
    return "<TaylorGreen>" if isinstance(data, dict | TaylorGreen) else "<vector>"


Velocity = Annotated[
    Annotated[Vector, Tag("<vector>")]
    | Annotated[LinearField, Tag("<LinearField>")]
    | Annotated[TaylorGreen, Tag("<TaylorGreen>")]
    | Annotated[StandingWave, Tag("<StandingWave>")],
    Discriminator(_velocity_tag),
]
