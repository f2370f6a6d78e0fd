"""Closed meshes of triangles: reading them, and their signed distance. Needs the extra `mesh`."""

from __future__ import annotations

import functools
import hashlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from taichi_rts.errors import SceneError
from taichi_rts.scene.obstacles.mesh import MeshObstacle, changed_mesh
from taichi_rts.scene.obstacles.solid import DistanceGrid, Solid, grid_nodes
from taichi_rts.scene.parts.rotations import rotation_matrix

FORMATS = (".obj", ".stl", ".ply")
MOST_KEPT = 1000  # meshes, as many as a scene may have
CANDIDATES = 8  # nearest points of the surface whose triangles are asked for the exact distance


@functools.lru_cache(maxsize=MOST_KEPT)
def load_mesh(obstacle: MeshObstacle) -> Any:
    """Return the `trimesh.Trimesh` of a mesh obstacle where it stands, not to be changed; raises `SceneError`.

    Its file is read once for each description.
    """
    path = Path(obstacle.file)
    if path.suffix.lower() not in FORMATS:
        raise SceneError(f"mesh file {obstacle.file!r} is no OBJ, STL or PLY file; convert it to one of {FORMATS}")
    if not path.is_file():
        raise SceneError(f"mesh file {obstacle.file!r} does not exist; check the path")
    try:
        import trimesh
    except ImportError as error:
        raise SceneError(
            f"mesh file {obstacle.file!r} cannot be read without {error.name}; install it: pip install 'taichi_rts[mesh]'"
        ) from None
    content = path.read_bytes()
    if obstacle.sha256 not in (None, hashlib.sha256(content).hexdigest()):
        raise SceneError(changed_mesh(obstacle.file, str(obstacle.sha256)) + ", or load the scene again")
    try:
        # From bytes: a material library or a texture that the file names is never looked for.
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type=path.suffix[1:].lower(), process=True)
    except Exception as error:  # readers raise anything for a file that is not what its name says
        raise SceneError(f"mesh file {obstacle.file!r} cannot be read: {error}; export it again") from None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise SceneError(f"mesh file {obstacle.file!r} holds no triangles; export a surface")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    if not np.isfinite(mesh.vertices).all():
        raise SceneError(f"mesh file {obstacle.file!r} has vertices that are no numbers; export it again")
    # Closed is a surface whose triangles pass each edge as often one way as the other: four may meet where it touches itself.
    ways = np.where(mesh.edges[:, 0] < mesh.edges[:, 1], 1.0, -1.0)
    uses, surplus = np.bincount(mesh.edges_unique_inverse), np.bincount(mesh.edges_unique_inverse, ways)
    if (uses % 2).any():
        raise SceneError(
            f"mesh file {obstacle.file!r} is open: {int((uses % 2).sum())} of its edges are not shared by exactly two "
            "triangles, so it has no inside; close its holes"
        )
    if surplus.any():
        raise SceneError(f"mesh file {obstacle.file!r} has triangles that face both ways; make its normals consistent")
    if mesh.volume <= 0.0:
        raise SceneError(
            f"mesh file {obstacle.file!r} is inside out: its volume is {mesh.volume:g}, which must be above 0; "
            "flip its normals"
        )
    turn = rotation_matrix(np.radians(obstacle.rotation)) if obstacle.rotation else np.eye(3)
    mesh.vertices = np.array(obstacle.scale) * mesh.vertices @ turn.T + np.array(obstacle.translation)
    return mesh


def mesh_solid(obstacle: MeshObstacle, spacing: float) -> Solid:
    """Return the geometry of a mesh; its distance is tabulated when it is first asked for, as it is asked for often."""
    mesh = load_mesh(obstacle)
    lower, upper = np.array(mesh.bounds[0]), np.array(mesh.bounds[1])
    extent = float((upper - lower).min())
    grids: list[DistanceGrid] = []

    def distance(x: np.ndarray) -> np.ndarray:
        if not grids:  # bounds alone decide most checks of a scene
            grids.append(_tabulate(mesh, lower, upper, spacing))
        return grids[0].at(x)

    def surface(step: float) -> np.ndarray:
        return _surface_points(mesh, step)[0]

    return Solid(distance, surface, lower, upper, extent)


def _surface_points(mesh: Any, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Points about `step` [m] apart, (M, 3), and the triangle of each, (M,): on a lattice in each triangle, corners included."""
    a, b, c = (mesh.triangles[:, k] for k in range(3))
    longest = np.max(
        [np.linalg.norm(b - a, axis=1), np.linalg.norm(c - b, axis=1), np.linalg.norm(a - c, axis=1)], axis=0
    )
    counts = np.maximum(1, np.ceil(longest / step)).astype(int)
    points, owners = [], []
    for n in np.unique(counts):
        which = np.flatnonzero(counts == n)
        u, v = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        u, v = u[u + v <= n] / n, v[u + v <= n] / n
        inside = a[which, None] + u[:, None] * (b - a)[which, None] + v[:, None] * (c - a)[which, None]
        points.append(inside.reshape(-1, 3))
        owners.append(np.repeat(which, len(u)))
    return np.concatenate(points), np.concatenate(owners)


def _tabulate(mesh: Any, lower: np.ndarray, upper: np.ndarray, spacing: float) -> DistanceGrid:
    """Signed distances of a mesh at the nodes of a grid around it.

    The distance is exact to one of the triangles that own the nearest points of a dense sample; the sign is the winding
    number along the column of nodes.
    """
    from scipy.spatial import cKDTree
    from trimesh.triangles import closest_point

    origin, shape, step = grid_nodes(lower, upper, spacing)
    points, owners = _surface_points(mesh, 0.5 * step)
    axes = [o + step * np.arange(n) for o, n in zip(origin, shape, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    # Far away a coarser sample is as good, to 0.06 spacings, and ten times as fast: in the middle of a ball all points are near.
    far, _ = cKDTree(_surface_points(mesh, spacing)[0]).query(nodes)
    close = np.flatnonzero(far < 3.1 * spacing)
    _, nearest = cKDTree(points).query(nodes[close], k=CANDIDATES)
    exact = far[close]
    for column in owners[nearest].T:
        foot = closest_point(mesh.triangles[column], nodes[close])
        exact = np.minimum(exact, np.linalg.norm(nodes[close] - foot, axis=1))
    far[close] = exact
    inside = _winding(mesh, axes) != 0
    return DistanceGrid(np.where(inside, -1.0, 1.0) * far.reshape(shape), origin, step)


def _winding(mesh: Any, axes: list[np.ndarray]) -> np.ndarray:
    """Winding number of the mesh around the nodes of a grid: crossings of the surface below a node, by their direction."""
    step = axes[0][1] - axes[0][0]
    shape = [len(axis) for axis in axes]
    corners = mesh.triangles[:, :, :2] - np.array([axes[0][0], axes[1][0]]) - step * np.array([1.234e-6, 2.345e-6])
    first = np.floor(corners.min(axis=1) / step).astype(int) + 1
    last = np.floor(corners.max(axis=1) / step).astype(int)
    size = np.maximum(last - first + 1, 0)
    counts = size.prod(axis=1)
    which = np.repeat(np.arange(len(counts)), counts)
    rank = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    column = first[which] + np.stack([rank // size[which, 1], rank % size[which, 1]], axis=1)
    a, b, c = (corners[which, k] for k in range(3))
    p = column * step

    def area(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return (u[:, 0] * v[:, 1]) - (u[:, 1] * v[:, 0])

    whole = area(b - a, c - a)
    weights = np.stack([area(b - p, c - p), area(c - p, a - p), area(a - p, b - p)])
    hit = (np.sign(weights) == np.sign(whole)).all(axis=0) & (whole != 0.0)
    z = (weights[:, hit] / whole[hit] * mesh.triangles[which[hit], :, 2].T).sum(axis=0)
    above = np.clip(np.ceil((z - axes[2][0]) / step).astype(int), 0, shape[2])
    turns = np.zeros((shape[0], shape[1], shape[2] + 1), np.int32)
    np.add.at(turns, (column[hit, 0], column[hit, 1], above), -np.sign(whole[hit]).astype(np.int32))
    return np.cumsum(turns, axis=2)[:, :, :-1]
