"""Rigid bodies of a SPlisHSPlasH scene: the container becomes the domain, boxes and closed meshes obstacles."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taichi_rts.errors import SceneError
from taichi_rts.scene.files.splishsplash_format import RigidBody, turn_of
from taichi_rts.scene.obstacles.mesh import MeshObstacle
from taichi_rts.scene.obstacles.mesh_files import load_mesh
from taichi_rts.scene.parts.rotations import rotation_matrix

ROUND = 1e-5
"""Share of its size by which a box's corners may be off."""


@dataclass(frozen=True)
class Body:
    """A rigid body with its file found; `vertices` [m], (V, 3), where it stands, `corners` None or, unturned, of its box.

    `name` is its place in the file, for messages.
    """

    name: str
    part: RigidBody
    file: Path
    vertices: np.ndarray
    corners: tuple[np.ndarray, np.ndarray] | None

    @property
    def turn(self) -> Any:
        """Rotation [degrees] as scenes give it, None where it does not turn."""
        return turn_of(self.part)

    @property
    def upright(self) -> bool:
        """Whether it is a box along the axes as it stands."""
        return self.corners is not None and as_box(self.vertices) is not None

    @property
    def is_container(self) -> bool:
        """Whether it holds the fluid."""
        return self.part.is_wall or self.part.map_invert


def read_body(name: str, part: RigidBody, file: Path) -> Body:
    """Find out where a body stands and whether it is a box; raises `SceneError` for a file that cannot be read."""
    local = np.asarray(part.scale) * mesh_vertices(name, file)
    turn = turn_of(part)
    matrix = rotation_matrix(np.radians(turn)) if turn else np.eye(3)
    return Body(name, part, file, local @ matrix.T + np.asarray(part.translation), as_box(local))


def mesh_vertices(name: str, file: Path) -> np.ndarray:
    """Vertices, (V, 3), of a mesh file. Those of an OBJ file are read without the extra `mesh`."""
    try:
        if file.suffix.lower() != ".obj":
            return np.asarray(load_mesh(MeshObstacle(str(file))).vertices)
        lines = file.read_text(errors="replace").splitlines()
        return np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float).reshape(-1, 3)[:, :]
    except OSError as error:
        raise SceneError(
            f"{name}.geometryFile: {str(file)!r} cannot be read: {error.strerror}; check the path"
        ) from None
    except ValueError:
        raise SceneError(f"{name}.geometryFile: {str(file)!r} is not a whole OBJ file; export it again") from None


def as_box(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the lower and the upper corner, (3,), if the vertices, (V, 3), are exactly a box's along the axes."""
    if not len(vertices):
        return None
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    slack = ROUND * float((high - low).max())
    if (high - low <= slack).any() or (np.minimum(vertices - low, high - vertices) > slack).any():
        return None
    return (low, high) if len(np.unique(vertices - low > slack, axis=0)) == 8 else None


def obstacle(body: Body, dim: int) -> dict[str, Any]:
    """Plain data of the obstacle that a body is; in two dimensions its section at z = 0. Raises `SceneError` if it has none."""
    part = body.part
    move = np.asarray(part.translation)
    if body.corners is not None and (dim == 3 or part.rotation_angle == 0.0 or abs(part.rotation_axis[2]) > 0.0):
        low, high = body.corners
        turn = turn_of(part, dim)
        middle = 0.5 * (low + high)[:dim]
        if turn:  # the file turns it about its origin, we about its middle
            middle = rotation_matrix(np.radians(turn)) @ middle
        half = 0.5 * (high - low)[:dim]
        middle = middle + move[:dim]
        found = {"shape": "box", "lower": (middle - half).tolist(), "upper": (middle + half).tolist()}
        return found | ({"rotation": list(turn)} if turn else {})
    mesh: dict[str, Any] = {"file": str(body.file), "scale": list(part.scale), "translation": list(part.translation)}
    mesh |= {"rotation": list(body.turn)} if body.turn else {}
    solid = load_mesh(MeshObstacle(**mesh))  # here, so that what is wrong with it is told apart from the scene's faults
    return {"shape": "mesh"} | mesh if dim == 3 else {"shape": "polygon", "points": section(body.name, solid).tolist()}


def section(name: str, mesh: Any) -> np.ndarray:
    """Largest loop, (K, 2), in which a mesh cuts the plane z = 0; raises `SceneError` if it does not."""
    from trimesh.intersections import mesh_plane

    segments = mesh_plane(mesh, (0.0, 0.0, 1.0), (0.0, 0.0, 1e-7 * float(np.ptp(mesh.vertices))))[:, :, :2]
    if not len(segments):
        raise SceneError(f"{name}: does not reach the plane z = 0 of a two-dimensional scene; move it there")
    grid = 1e-7 * float(np.ptp(mesh.vertices))
    points, ends = np.unique(np.round(segments.reshape(-1, 2) / grid).astype(np.int64), axis=0, return_inverse=True)
    following: dict[int, list[int]] = {}
    for a, b in ends.reshape(-1, 2).tolist():
        if a != b:
            following.setdefault(a, []).append(b)
            following.setdefault(b, []).append(a)
    loops = []
    while following:
        loop = [next(iter(following))]
        while nexts := following.get(loop[-1]):
            there = nexts.pop()
            back = following.get(there, [])
            if loop[-1] in back:
                back.remove(loop[-1])
            loop.append(there)
        for node in loop:
            if node in following and not following[node]:
                del following[node]
        loops.append(points[loop[:-1] if loop[0] == loop[-1] else loop] * grid)
    return max(loops, key=lambda loop: abs(area(loop)))


def area(loop: np.ndarray) -> float:
    """Area [m^2] of a polygon, (K, 2), negative if it goes clockwise."""
    (x, y), (u, v) = loop.T, np.roll(loop, -1, axis=0).T
    return 0.5 * float((x * v - u * y).sum())


def motor(joint: dict[str, Any]) -> dict[str, Any] | None:
    """Motion of the first body of a hinge with a motor, as scenes give it; None where its speed is not one number."""
    axis, place, target = joint.get("axis"), joint.get("position"), joint.get("target")
    vectors = all(isinstance(v, list) and len(v) == 3 for v in (axis, place))
    numbers = vectors and all(isinstance(x, (int, float)) for x in itertools.chain(axis, place, [target]))  # type: ignore[arg-type]
    length = float(np.linalg.norm(axis)) if numbers else 0.0  # type: ignore[arg-type]
    if not length:
        return None
    return {"angular_velocity": [x / length * target for x in axis], "pivot": place}  # type: ignore[union-attr, operator]
