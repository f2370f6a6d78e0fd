"""Fluid whose particles are given one by one: from arrays, or from a file that another run or tool wrote."""

from __future__ import annotations

import functools
import hashlib
import math
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, ConfigDict, model_serializer, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.particle_files.formats import read_particles
from taichi_rts.particle_files.frame import ParticleFrame
from taichi_rts.scene.fluids.shape import FluidShape
from taichi_rts.scene.near_pairs import nearest_pair
from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.parts.rotations import Turn, rotation_matrix
from taichi_rts.scene.validation import Colour, NotNegative, Positive, Vector, validated

LEAST_DISTANCE = 0.1
"""Particles may not lie nearer to each other than this share of the spacing: in violent runs a pair comes as near as 0.24."""


def _frozen_array(value: Any) -> np.ndarray | None:
    if value is None:
        return None
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{type(value).__name__} is no array of numbers; give a NumPy array") from None
    array.setflags(write=False)
    return array


Array = Annotated[Any, BeforeValidator(_frozen_array)]


@validated(SceneError)
@dataclass(frozen=True, eq=False, repr=False, config=ConfigDict(extra="forbid", allow_inf_nan=False))
class Particles(FluidShape):
    """Fluid particles given one by one, by arrays or by a `file` (vtu, ply, npz, bgeo, csv) that holds them.

    Every particle has the mass that the scene's spacing gives it, so the scene must have the spacing that they were made with.

    Attributes:
        positions: [m], (N, dim), inside the domain, no two nearer than `LEAST_DISTANCE` times the spacing.
        velocities: [m/s], (N, dim); None: at rest, or those of the file.
        densities: [kg/m^3], (N,), at the start where density is integrated; None: the rest density, or those of the file.
        file: path of a particle file, instead of arrays.
        scale, rotation, translation: metres per unit of the file, [degrees] about its origin after scaling, and [m], (dim,),
            after turning: where the file's particles are put. A rotation turns their velocities as well, which `scale` leaves.
        sha256: what the content must be, as `Scene.to_dict` says it; None: anything.
        kinematic_viscosity: nu [m^2/s]; None: the scene's.
        colour: of pictures by fluid, "orange" or "#RRGGBB"; None: one of the palette.
    """

    positions: Array = None
    velocities: Array = None
    densities: Array = None
    file: str | None = None
    scale: Positive = 1.0
    rotation: Turn | None = None
    translation: Vector | None = None
    sha256: str | None = None
    kinematic_viscosity: NotNegative | None = None
    colour: Colour | None = None
    telling = frozenset({"positions", "velocities", "file", "sha256"})

    @model_validator(mode="before")
    @classmethod
    def _check_kind(cls, data: Any) -> Any:
        given = getattr(data, "kwargs", None) or (data if isinstance(data, dict) else {})
        if "count" in given:
            raise ValueError(
                f"only says that there were {given['count']} particles; write them to a file with "
                "taichi_rts.write_particles and give that"
            )
        return data

    @model_validator(mode="after")
    def _check(self) -> Particles:
        if hasattr(self, "_spacing"):
            return self  # done: pydantic asks again for each scene that takes them
        if (self.positions is None) == (self.file is None):
            raise ValueError("give either positions or a file")
        if self.file is None and self._placement:
            raise ValueError(
                f"{', '.join(self._placement)}: only a file's particles are put elsewhere; change the positions"
            )
        frame = self._read(self.file) if self.file is not None else None
        _check_arrays(self.positions, self.velocities, self.densities)
        if self.sha256 not in (None, self.digest):
            raise ValueError(
                f"the particles of {self.file or 'positions'} are others than those of sha256 {self.sha256}"
            )
        spacing = frame.spacing if frame else None
        object.__setattr__(self, "_spacing", None if spacing is None else spacing * self.scale)
        return self

    def _read(self, path: str) -> ParticleFrame:
        if self.velocities is not None or self.densities is not None:
            raise ValueError(f"velocities and densities come from the file {path!r}; leave them out")
        try:
            frame = read_particles(path)
        except SceneError as error:
            raise ValueError(str(error)) from None
        velocity = frame.attributes.get("velocity")
        found = {"positions": self._place(frame.positions), "densities": frame.attributes.get("density")}
        found["velocities"] = velocity if velocity is None or not self.rotation else velocity @ self._turn.T
        for name, values in found.items():
            object.__setattr__(self, name, _frozen_array(values))
        return frame

    @property
    def _placement(self) -> dict[str, Any]:
        """What is said about where a file's particles are put."""
        given = {"scale": self.scale, "rotation": self.rotation, "translation": self.translation}
        return {name: value for name, value in given.items() if value not in (None, 1.0)}

    @property
    def _turn(self) -> np.ndarray:
        return rotation_matrix(np.radians(self.rotation))  # type: ignore[arg-type]

    def _place(self, x: np.ndarray) -> np.ndarray:
        """Where positions of the file, (N, dim), are put [m]."""
        dim = x.shape[1]
        for name, value, needed in (
            ("rotation", self.rotation, 1 if dim == 2 else 3),
            ("translation", self.translation, dim),
        ):
            if value is not None and len(value) != needed:
                raise ValueError(f"{name} {value} has {len(value)} components; in {dim} dimensions give {needed}")
        x = np.asarray(x, float) * self.scale
        return (x @ self._turn.T if self.rotation else x) + np.asarray(self.translation or 0.0)

    def translated(self, shift: Vector) -> Particles:
        """Return the same particles, given by arrays, moved by `shift` [m], (dim,)."""
        moved = Particles(
            self.positions + np.asarray(shift),
            self.velocities,
            self.densities,
            kinematic_viscosity=self.kinematic_viscosity,
            colour=self.colour,
        )
        object.__setattr__(moved, "_spacing", self.spacing)
        return moved

    @model_serializer
    def _describe(self) -> dict[str, Any]:
        """Plain data: the file, or how many particles there are, with the hash that tells them from others."""
        found = {"file": self.file, **self._placement} if self.file is not None else {"count": self.count}
        own = {"kinematic_viscosity": self.kinematic_viscosity, "colour": self.colour}
        return found | {"sha256": self.digest} | {name: value for name, value in own.items() if value is not None}

    def __repr__(self) -> str:
        return f"Particles({self.file!r})" if self.file is not None else f"Particles({self.count})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Particles):
            return NotImplemented
        mine, its = ((each.digest, each.kinematic_viscosity, each.colour) for each in (self, other))
        return mine == its

    def __hash__(self) -> int:
        return hash(self.digest)

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 of the arrays."""
        found = hashlib.sha256()
        for values in (self.positions, self.velocities, self.densities):
            found.update(b"-" if values is None else str(values.shape).encode() + values.tobytes())
        return found.hexdigest()

    @property
    def spacing(self) -> float | None:
        """Spacing [m] of the scene that the particles are from; None if it is not known."""
        return self._spacing  # type: ignore[attr-defined]

    @property
    def count(self) -> int:
        """Number of particles N."""
        return len(self.positions)

    @functools.cached_property
    def lower(self) -> Vector:
        """Lower corner [m], (dim,), of the bounding box of all centres."""
        return tuple(self.positions.min(axis=0).tolist())

    @functools.cached_property
    def upper(self) -> Vector:
        """Upper corner [m], (dim,), of the bounding box of all centres."""
        return tuple(self.positions.max(axis=0).tolist())

    @functools.cached_property
    def top_speed(self) -> float:
        """Largest speed [m/s]."""
        return 0.0 if self.velocities is None else float(np.linalg.norm(self.velocities, axis=1).max())

    @functools.lru_cache(maxsize=4)  # noqa: B019 - scenes are built again and again with the same particles
    def nearest_pair(self, limit: float) -> tuple[float, int, int] | None:
        """Return distance [m] and places of the nearest two, if below `limit` [m]."""
        return nearest_pair(self.positions, limit)

    @property
    def outline(self) -> str:
        """Where they are, for messages."""
        return f"particles from {self.lower} to {self.upper}"

    def reach(self, direction: Vector) -> float:
        """Largest value of direction.x over the centres [m times the unit of `direction`, (dim,)]."""
        return float((self.positions @ np.asarray(direction)).max())

    @property
    def extent(self) -> None:
        """Particles have no extent that a spacing could exceed."""
        return None

    def volume_at(self, spacing: float) -> float:
        """Volume of so many cells of `spacing` [m]."""
        return float(self.count * spacing ** len(self.lower))

    def contains(self, x: np.ndarray) -> np.ndarray:
        """All of the bounding box."""
        return np.ones(len(x), bool)

    def fill(self, steps: Vector, domain: Box) -> np.ndarray:
        """Positions [m], (N, dim), as given, but none beyond the domain, where rounding may have put it."""
        return np.clip(self.positions, domain.lower, domain.upper)

    def velocities_at(self, x: np.ndarray) -> np.ndarray:
        """Velocities [m/s], (N, dim), as given."""
        return np.zeros_like(x) if self.velocities is None else self.velocities

    def separation(self, other: Any) -> float:
        """Least distance [m] of a centre from a block or a sphere, negative inside of it; infinite from other particles."""
        if isinstance(other, Particles):
            return math.inf
        if hasattr(other, "radius"):
            return float(np.linalg.norm(self.positions - np.asarray(other.centre), axis=1).min()) - float(other.radius)
        outside = np.maximum(np.asarray(other.lower) - self.positions, self.positions - np.asarray(other.upper))
        inside = outside.max(axis=1)
        return float(np.where(inside < 0.0, inside, np.linalg.norm(np.maximum(outside, 0.0), axis=1)).min())


def _check_arrays(x: np.ndarray, v: np.ndarray | None, rho: np.ndarray | None) -> None:
    if x.ndim != 2 or x.shape[1] not in (2, 3) or not len(x):
        raise ValueError(f"positions have the shape {x.shape}; (N, 2) or (N, 3) is needed, with N at least 1")
    if v is not None and v.shape != x.shape:
        raise ValueError(f"velocities have the shape {v.shape}; that of the positions {x.shape} is needed")
    if rho is not None and rho.shape != x.shape[:1]:
        raise ValueError(f"densities have the shape {rho.shape}; {x.shape[:1]} is needed, one for each position")
    for name, values in (("positions", x), ("velocities", v), ("densities", rho)):
        if values is not None and not np.isfinite(values).all():
            first = int(np.flatnonzero(~np.isfinite(values.reshape(len(x), -1)).all(axis=1))[0])
            raise ValueError(f"{name}: that of particle {first} is {values[first]}; finite numbers are needed")
    if rho is not None and rho.min() <= 0.0:
        raise ValueError(f"densities: that of particle {int(rho.argmin())} is {rho.min():g}; it must be above 0")
