"""How an obstacle moves: at constant velocities, or through a table of positions and rotations."""

from __future__ import annotations

import functools
import itertools
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Len
from pydantic import Discriminator, Tag, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.parts.rotations import Turn, rotation_matrix
from taichi_rts.scene.validation import FROZEN, NotNegative, Positive, Vector, validated


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
    """A body that moves at constant velocities.

    Attributes:
        velocity: [m/s], (dim,); None: 0.
        angular_velocity: [rad/s] about the pivot: one number in two dimensions, counter-clockwise, in three a vector along the
            axis; None: 0.
        pivot: [m], (dim,), where the pivot is at the start; it moves on with the body. None: the middle of its bounding box.
        start: [s], from which on it moves.
        stop: [s], until which it moves; None: for ever.
    """

    velocity: Vector | None = None
    angular_velocity: Turn | None = None
    pivot: Vector | None = None
    start: NotNegative = 0.0
    stop: Positive | None = None
    places = ("pivot",)

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
    places = ("pivot",)

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
        return self._pieces

    @functools.cached_property
    def _pieces(self) -> Pieces:
        """Worked out once: there may be 100,000."""
        rows = self.displacements or self.rotations or ()
        dim = len(rows[0]) if self.displacements else (2 if len(rows[0]) == 1 else 3)
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
    return "<Keyframes>" if is_table else "<ConstantMotion>"


Motion = Annotated[
    Annotated[ConstantMotion, Tag("<ConstantMotion>")] | Annotated[Keyframes, Tag("<Keyframes>")],
    Discriminator(_motion_tag),
]


def _turn_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rotation [rad] that leads from the rotation `a` to `b`, both like the argument of `rotation_matrix`."""
    if len(a) == 1 or np.linalg.norm(np.cross(a, b)) < 1e-12:
        return b - a
    # Not at the top: few scenes come here, and its import takes longer than NumPy's.
    from scipy.spatial.transform import Rotation

    return (Rotation.from_rotvec(b) * Rotation.from_rotvec(a).inv()).as_rotvec()
