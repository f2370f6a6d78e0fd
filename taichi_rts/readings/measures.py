"""Measures of a state in NumPy: front, pressures at points, heights of water, forces on the domain's faces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from taichi_rts.assembly.following import follows
from taichi_rts.medium.medium import Medium
from taichi_rts.sampling.faces import faces_of, line_walls, no_walls, walls_near
from taichi_rts.scene.geometry.periodic import nearest_image, periods
from taichi_rts.scene.near_pairs import near_pairs
from taichi_rts.scene.parts.conditions import AXES, face_axis
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.physics.continuity import rise_of_pressure, with_image

FRONT_RANK = 5
"""The front is the FRONT_RANK-th largest x, so that single drops that fly ahead do not count."""
SURFACE = 0.5
"""Share of the full lattice's sum of kernels at the water's surface: on a plane surface half of the support is full."""
PITCH = 1.0 / 16.0
"""Distance of the points on a gauge's line, over the support radius."""
SLOPES = 1000  # entries of the table of dW/dd over the distance


def front(x: np.ndarray) -> float:
    """Front of the fluid [m]: its fifth-largest x, 0 without any; `x` [m] is (N, dim)."""
    along, rank = x[:, 0], min(FRONT_RANK, len(x))
    return float(np.partition(along, -rank)[-rank]) if rank else 0.0


def interpolate(x: np.ndarray, values: np.ndarray, points: np.ndarray, kernel: Any, lengths: np.ndarray) -> np.ndarray:
    """Values at `points` [m], (P, dim): sum_j A_j W_j / sum_j W_j over the support radius, 0 where it is empty.

    `x` [m], (N, dim), and `values`, (N,), are the particles'. Shepard's interpolation: exact for constants up to the walls, and
    at a wall the mean over the half of the support that has water in it.
    """
    found = np.zeros(len(points))
    for i, point in enumerate(points):
        gap = nearest_image(x.astype(np.float64) - point, lengths)
        weights = kernel.sample(np.linalg.norm(gap, axis=1))
        if (total := weights.sum()) > 0.0:
            found[i] = float(weights @ values.astype(np.float64)) / total
    return found


def water_height(scene: Scene, medium: Medium, x: np.ndarray, position: np.ndarray) -> float:
    """Height [m] of the water's surface over the domain's floor on the line along gravity through `position` [m], (dim,).

    The highest point at which phi = sum_j m/rho_0 W_j falls to 1/2, 0 where it nowhere reaches that; particles `x` [m], (N, dim).
    A particle on its own has less, so single drops do not count. Beyond walls the water is thought mirrored. Without gravity
    the line is along y.
    """
    gravity, r = np.asarray(scene.acceleration), medium.support
    axis = int(np.argmax(np.abs(gravity))) if gravity.any() else 1
    up = -1.0 if gravity[axis] > 0.0 else 1.0
    floor, top = (scene.domain.lower, scene.domain.upper)[:: int(up)]
    gap = nearest_image(x.astype(np.float64) - position, periods(scene))
    gap[:, axis] = up * (x[:, axis] - floor[axis])  # from here on the height
    for d in range(scene.dim):
        near = gap if d == axis else gap[np.abs(gap[:, d]) < r]
        if d == axis:
            faces = [0.0]
        else:
            faces = [] if scene.is_periodic[d] else [scene.domain.lower[d], scene.domain.upper[d]]
            faces = [face - position[d] for face in faces if abs(face - position[d]) < r]
        images = [near * np.where(np.arange(scene.dim) == d, -1.0, 1.0) for _ in faces]
        for image, face in zip(images, faces, strict=True):
            image[:, d] += 2.0 * face
        gap = np.concatenate([near, *images])
        gap = gap if d == axis else gap[np.abs(gap[:, d]) < r]
    pitch, last = PITCH * r, math.ceil(up * (top[axis] - floor[axis]) / (PITCH * r))
    aside2 = (np.delete(gap, axis, axis=1) ** 2).sum(axis=1)
    point = np.ceil((gap[:, axis] - r) / pitch).astype(np.int64)[:, None] + np.arange(math.ceil(2.0 / PITCH) + 1)
    distance = np.sqrt(aside2[:, None] + (point * pitch - gap[:, axis, None]) ** 2)
    there = (point >= 0) & (point <= last)
    phi = np.bincount(point[there], medium.kernel.sample(distance[there]), last + 1) * medium.mass / medium.rest_density
    wet = np.flatnonzero(phi >= SURFACE)
    if not len(wet):
        return 0.0
    k = int(wet[-1])
    return pitch * (k + (phi[k] - SURFACE) / (phi[k] - phi[k + 1]) if k < last else last)


class FaceForces:
    """Forces of the water's pressure on the faces of the domain's box: the reaction to what the walls do to the fluid.

    F_b = -sum_i m rho_0 V_b (c_i + c_ib) grad W_ib with c_i = p_i/rho_i^2 (Akinci et al. 2012, Eq. 9) and c_ib that of the
    image where density is integrated (`with_image`, as `MirroredPressure` has it), else 0. A face has the component along its
    normal of all wall particles behind it, so that those behind an edge count for both faces. Friction on the walls is not in
    it.
    """

    def __init__(self, scene: Scene, medium: Medium) -> None:
        self.scene = scene
        self.medium = medium
        self.follows = follows(scene)
        self.lattices = faces_of(scene) if self.follows else []
        self.layer, self.owners = no_walls(scene) if self.follows else line_walls(scene)
        self.behind = {face: mask for face, mask in self._behind().items() if mask.any() or self.lattices}
        self.distances = np.linspace(0.0, scene.support, SLOPES)
        self.slopes = np.gradient(medium.kernel.sample(self.distances), self.distances)

    @property
    def faces(self) -> list[str]:
        """Names of the faces that have a wall, "x-", "x+" and so on."""
        return list(self.behind)

    def _behind(self) -> dict[str, np.ndarray]:
        """For each face, which wall particles, (M,), lie behind it."""
        found: dict[str, np.ndarray] = {}
        x, domain = self.layer.positions, self.scene.domain
        for d in range(self.scene.dim):
            found |= {AXES[d] + "-": x[:, d] < domain.lower[d], AXES[d] + "+": x[:, d] > domain.upper[d]}
        return found

    def at(self, time: float, x: np.ndarray, rho: np.ndarray, p: np.ndarray) -> list[float]:
        """Forces [N] (per metre of depth in two dimensions) along the outward normals of `faces` at `time` [s].

        Positions [m], (N, dim), densities [kg/m^3] and pressures [Pa], (N,), are the particles'.
        """
        if not self.behind:
            return []
        if self.follows:  # only those near the water: of all there may be millions
            self.layer = walls_near(self.scene, self.lattices, x.astype(np.float64))
            self.behind = self._behind()
        forces = self._on_particles(time, x, rho, p)
        return [
            (1.0 if face[1] == "+" else -1.0) * float(forces[mask, face_axis(face)].sum())
            for face, mask in self.behind.items()
        ]

    def _on_particles(self, time: float, x: np.ndarray, rho: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Forces [N] on the wall particles, (M, dim)."""
        scene, layer = self.scene, self.layer
        places = layer.positions.copy()
        for number, wall in enumerate(scene.moving_walls):
            places[self.owners == number, face_axis(wall.face)] += wall.displacement(time)
        rise = np.array(rise_of_pressure(scene))
        near = self._near_walls(places, x)
        x, own = x[near].astype(np.float64), p[near].astype(np.float64) / rho[near].astype(np.float64) ** 2
        forces = np.zeros_like(places)
        for i, b, distance2 in near_pairs(x, scene.support, places):
            gap, distance = x[i] - places[b], np.sqrt(distance2)
            push = own[i]
            if scene.density == "continuity":
                push = with_image(push, gap @ rise, np.maximum)
            push = (
                push * layer.volumes[b] * np.interp(distance, self.distances, self.slopes) / np.maximum(distance, 1e-12)
            )
            for d in range(scene.dim):
                forces[:, d] += np.bincount(b, push * gap[:, d], len(places))
        return self.medium.mass * scene.rest_density * forces

    def _near_walls(self, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Mask of the particles, (N,), that may be near a wall particle: all but those well inside the box that is left."""
        near = np.zeros(len(x), bool)
        for face, mask in self.behind.items():
            d, r = face_axis(face), self.scene.support
            if not mask.any():
                continue
            along = places[mask, d]
            near |= x[:, d] < along.max() + r if face[1] == "-" else x[:, d] > along.min() - r
        return near
