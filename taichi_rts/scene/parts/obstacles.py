"""Rigid bodies in the fluid as a scene describes them: boxes, spheres, cylinders, polygons, meshes; at rest or moving."""

from __future__ import annotations

import hashlib
import itertools
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Len
from pydantic import BeforeValidator, Discriminator, Tag, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.parts.rotations import Turn, number_or_list, rotation_matrix
from taichi_rts.scene.parts.shapes import Box
from taichi_rts.scene.validation import FROZEN, NotNegative, Number, Positive, Vector, validated


def _as_scale(value: Any) -> Any:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return value
    if not value > 0.0:
        raise ValueError(f"{value} must be above 0")  # once, not for each axis
    return (value,) * 3


Scale = Annotated[tuple[Positive, ...], Len(3, 3), BeforeValidator(_as_scale), number_or_list(3)]
"""One number, or one for each axis."""


class Pieces(NamedTuple):
    """A motion cut into P pieces, in each of which the velocity u and the angular velocity w are constant.

    At `starts` [s] + t the pivot has moved by `shifts` + u t [m], (P, dim), and the body has turned by exp(w t) `turns`,
    (P, dim, dim). `durations` [s] are those of the pieces, after which the body rests until the next begins. w [rad/s] is
    (P, 1) in two dimensions and (P, 3) in three.
    """

    starts: np.ndarray
    durations: np.ndarray
    shifts: np.ndarray
    turns: np.ndarray
    velocities: np.ndarray
    spins: np.ndarray

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Shift of the pivot [m], (dim,), and rotation, (dim, dim), at `time` [s]."""
        n = max(int(np.searchsorted(self.starts, time, side="right")) - 1, 0)
        t = float(np.clip(time - self.starts[n], 0.0, self.durations[n]))
        return self.shifts[n] + self.velocities[n] * t, rotation_matrix(self.spins[n] * t) @ self.turns[n]


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class ConstantMotion:
    """A body that moves at `velocity` [m/s], (dim,), and turns about its pivot at `angular_velocity` [rad/s].

    From `start` [s] to `stop` [s], None: for ever. In two dimensions `angular_velocity` is one number, counter-clockwise,
    in three a vector along the axis. `pivot` [m], (dim,), is where the pivot is at the start and moves on with the body; None:
    the middle of its bounding box.
    """

    velocity: Vector | None = None
    angular_velocity: Turn | None = None
    pivot: Vector | None = None
    start: NotNegative = 0.0
    stop: Positive | None = None

    @model_validator(mode="after")
    def _check(self) -> ConstantMotion:
        if self.velocity is None and self.angular_velocity is None:
            raise ValueError("moves nothing; give velocity [m/s] or angular_velocity [rad/s], or leave motion out")
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(f"stop {self.stop} must exceed start {self.start}")
        return self

    def pieces(self, dim: int) -> Pieces:
        """Return the one piece that it is."""
        return Pieces(
            starts=np.array([self.start]),
            durations=np.array([1e30 if self.stop is None else self.stop - self.start]),
            shifts=np.zeros((1, dim)),
            turns=np.eye(dim)[None],
            velocities=np.array([self.velocity or (0.0,) * dim]),
            spins=np.array([self.angular_velocity or (0.0,) * (1 if dim == 2 else 3)]),
        )

    def components(self) -> list[tuple[str, Any, bool]]:
        """Name, value and whether it is a rotation, of all that has to fit the scene's dimension."""
        return [("velocity", self.velocity, False), ("angular_velocity", self.angular_velocity, True)]


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Keyframes:
    """A body that is led through a table of positions and rotations.

    Attributes:
        times: [s], (K,), ascending; the body rests before the first and after the last.
        displacements: of the pivot from where it stands [m], (K, dim), linear in between; None: none.
        rotations: [degrees] from how it stands, (K,) in two dimensions, (K, 3) in three, at a constant rate in between; turns
            about one axis may exceed 360, others take the shortest way; None: none.
        pivot: [m], (dim,), about which it turns; None: the middle of its bounding box.

    The first displacement and rotation must be 0.
    """

    times: Annotated[tuple[NotNegative, ...], Len(2)]
    displacements: tuple[Vector, ...] | None = None
    rotations: tuple[Turn, ...] | None = None
    pivot: Vector | None = None

    @model_validator(mode="after")
    def _check(self) -> Keyframes:
        if any(a >= b for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ValueError(f"times {self.times} must ascend")
        if self.displacements is None and self.rotations is None:
            raise ValueError("moves nothing; give displacements [m] or rotations [degrees], or leave motion out")
        for name in ("displacements", "rotations"):
            rows = getattr(self, name)
            if rows is None:
                continue
            if len(rows) != len(self.times):
                raise ValueError(f"times has {len(self.times)} entries, {name} {len(rows)}; give as many")
            if len({len(row) for row in rows}) > 1:
                raise ValueError(f"{name} differ in their number of components; give all the scene's")
            if any(rows[0]):
                raise ValueError(f"{name} begin with {rows[0]}; the first must be 0, how the body stands in the scene")
        return self

    def pieces(self, dim: int) -> Pieces:
        """Return K-1 pieces, and one at rest after the last."""
        times = np.array(self.times)
        shifts = np.array(self.displacements or [(0.0,) * dim] * len(times))
        angles = np.radians(np.array(self.rotations or [(0.0,) * (1 if dim == 2 else 3)] * len(times)))
        turns = np.array([rotation_matrix(angle) for angle in angles])
        steps = np.diff(times)[:, None]
        spins = np.array([_turn_between(a, b) for a, b in itertools.pairwise(angles)]) / steps
        still = np.zeros((1, dim))
        return Pieces(
            starts=times,
            durations=np.append(steps[:, 0], 1e30),
            shifts=shifts,
            turns=turns,
            velocities=np.concatenate([np.diff(shifts, axis=0) / steps, still]),
            spins=np.concatenate([spins, np.zeros_like(spins[:1])]),
        )

    def components(self) -> list[tuple[str, Any, bool]]:
        """Name, value and whether it is a rotation, of all that has to fit the scene's dimension."""
        rows = [("displacements", self.displacements, False), ("rotations", self.rotations, True)]
        return [(name, values and values[0], turns) for name, values, turns in rows]


def _motion_tag(data: Any) -> str:
    keys = data.keys() if isinstance(data, dict) else set()
    is_table = isinstance(data, Keyframes) or bool({"times", "displacements", "rotations"} & keys)
    return "<keyframes>" if is_table else "<constant>"


Motion = Annotated[
    Annotated[ConstantMotion, Tag("<constant>")] | Annotated[Keyframes, Tag("<keyframes>")], Discriminator(_motion_tag)
]


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class BoxObstacle:
    """A box between two corners `lower` and `upper` [m], (dim,), turned by `rotation` [degrees] about its middle.

    `motion` says how it moves, None: not at all; in a scene file its `shape` is "box". Raises `SceneError`.
    """

    lower: Vector
    upper: Vector
    rotation: Turn | None = None
    motion: Motion | None = None
    shape: Literal["box"] = "box"

    @model_validator(mode="after")
    def _check(self) -> BoxObstacle:
        Box(self.lower, self.upper)
        return self

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return len(self.lower)


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class SphereObstacle:
    """A sphere, in two dimensions a disc, around `centre` [m], (dim,), with `radius` [m].

    `motion` says how it moves, None: not at all; in a scene file its `shape` is "sphere". Raises `SceneError`.
    """

    centre: Vector
    radius: Positive
    motion: Motion | None = None
    shape: Literal["sphere"] = "sphere"

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return len(self.centre)


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class CylinderObstacle:
    """A round cylinder with `radius` [m] whose axis goes from `start` to `end` [m], (3,).

    `motion` says how it moves, None: not at all; in a scene file its `shape` is "cylinder". Raises `SceneError`.
    """

    start: Annotated[tuple[Number, ...], Len(3, 3)]
    end: Annotated[tuple[Number, ...], Len(3, 3)]
    radius: Positive
    motion: Motion | None = None
    shape: Literal["cylinder"] = "cylinder"
    dim = 3

    @model_validator(mode="after")
    def _check(self) -> CylinderObstacle:
        if self.start == self.end:
            raise ValueError(f"start and end are both {self.start}; give the axis a length")
        return self


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class PolygonObstacle:
    """A polygon in two dimensions with corners `points` [m], (K, 2), in either direction, whose edges do not cross.

    `motion` says how it moves, None: not at all; in a scene file its `shape` is "polygon". Raises `SceneError`.
    """

    points: Annotated[tuple[Annotated[tuple[Number, ...], Len(2, 2)], ...], Len(3)]
    motion: Motion | None = None
    shape: Literal["polygon"] = "polygon"
    dim = 2

    @model_validator(mode="after")
    def _check(self) -> PolygonObstacle:
        x, y = np.array(self.points).T
        area = 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
        if abs(area) <= 1e-12 * (np.ptp(x) + np.ptp(y)) ** 2 or len(set(self.points)) < len(self.points):
            raise ValueError(f"points {self.points} enclose no area or repeat; give each corner once")
        return self


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class MeshObstacle:
    """A closed surface of triangles from an OBJ, STL or PLY file; needs the extra `mesh`.

    Attributes:
        file: its path; in a scene file relative to that file, in whose folder it must lie.
        scale: metres per unit of the file, one number or one for each axis.
        rotation: [degrees] about the file's origin, after scaling.
        translation: [m], (3,), after turning.
        motion: how it moves; None: not at all.
        sha256: what the content of the file must be, as `Scene.to_dict` says it; None: anything.
        shape: "mesh", as a scene file has it.
    """

    file: str
    scale: Scale = (1.0, 1.0, 1.0)
    rotation: Turn | None = None
    translation: Annotated[tuple[Number, ...], Len(3, 3)] = (0.0, 0.0, 0.0)
    motion: Motion | None = None
    sha256: str | None = None
    shape: Literal["mesh"] = "mesh"
    dim = 3

    @model_validator(mode="after")
    def _take_digest(self) -> MeshObstacle:
        """Know the mesh by its content: a file that is edited later is another obstacle."""
        digest = file_digest(self.file)
        if self.sha256 is None:
            object.__setattr__(self, "sha256", digest)
        elif digest not in (None, self.sha256):
            raise ValueError(changed_mesh(self.file, self.sha256))
        return self


def file_digest(file: str) -> str | None:
    """SHA-256 of a file's content; None if it cannot be read."""
    try:
        with open(file, "rb") as content:
            found = hashlib.sha256()
            while chunk := content.read(1 << 20):
                found.update(chunk)
            return found.hexdigest()
    except (OSError, ValueError):  # a zero byte in a path is no OSError
        return None


def changed_mesh(file: str, sha256: str) -> str:
    """Say that a mesh is not what it was."""
    return (
        f"mesh file {file!r} has changed: its content is not that of sha256 {sha256[:12]}...; put the earlier file back"
    )


SHAPES = {
    "box": BoxObstacle,
    "sphere": SphereObstacle,
    "cylinder": CylinderObstacle,
    "polygon": PolygonObstacle,
    "mesh": MeshObstacle,
}


def _shape_tag(data: Any) -> str | None:
    shape = data.get("shape") if isinstance(data, dict) else getattr(data, "shape", None)
    return f"<{shape}>" if isinstance(shape, str) and shape in SHAPES else None


Obstacle = Annotated[
    Annotated[BoxObstacle, Tag("<box>")]
    | Annotated[SphereObstacle, Tag("<sphere>")]
    | Annotated[CylinderObstacle, Tag("<cylinder>")]
    | Annotated[PolygonObstacle, Tag("<polygon>")]
    | Annotated[MeshObstacle, Tag("<mesh>")],
    Discriminator(
        _shape_tag,
        custom_error_type="unknown_shape",
        custom_error_message=f"shape is missing or unknown; choose one of {', '.join(SHAPES)}",
    ),
]
"""A body of any shape; a scene file names it by `shape`."""


def _turn_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rotation [rad] that leads from the rotation `a` to `b`, both like the argument of `rotation_matrix`."""
    if len(a) == 1 or np.linalg.norm(np.cross(a, b)) < 1e-12:
        return b - a
    # Not at the top: few scenes come here, and its import takes longer than NumPy's.
    from scipy.spatial.transform import Rotation

    return (Rotation.from_rotvec(b) * Rotation.from_rotvec(a).inv()).as_rotvec()
