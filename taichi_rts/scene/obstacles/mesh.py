"""Meshes as obstacles: the description. How their files are read and their distances found stands in `mesh_files.py`."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any, Literal

from annotated_types import Len
from pydantic import BeforeValidator, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.obstacles.motion import Motion
from taichi_rts.scene.obstacles.shape import ObstacleShape
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.parts.rotations import Turn, number_or_list
from taichi_rts.scene.validation import FROZEN, Number, Positive, validated


def _as_scale(value: Any) -> Any:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return value
    if not value > 0.0:
        raise ValueError(f"{value} must be above 0")  # once, not for each axis
    return (value,) * 3


Scale = Annotated[tuple[Positive, ...], Len(3, 3), BeforeValidator(_as_scale), number_or_list(3)]
"""One number, or one for each axis."""


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class MeshObstacle(ObstacleShape):
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
    places = ("translation",)

    @model_validator(mode="after")
    def _take_digest(self) -> MeshObstacle:
        """Know the mesh by its content: a file that is edited later is another obstacle."""
        digest = file_digest(self.file)
        if self.sha256 is None:
            object.__setattr__(self, "sha256", digest)
        elif digest not in (None, self.sha256):
            raise ValueError(changed_mesh(self.file, self.sha256))
        return self

    def solid(self, spacing: float, domain: Box | None) -> Solid:
        """Return the geometry of the mesh; its distance is tabulated when it is first asked for."""
        from taichi_rts.scene.obstacles.mesh_files import mesh_solid  # only here: it needs the extra `mesh`

        return mesh_solid(self, spacing)


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
