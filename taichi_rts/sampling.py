"""From a scene to particles: pure functions on NumPy arrays, before anything runs on a device."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from taichi_rts.scene import Block, Scene
from taichi_rts.smoothing import lattice_sum, make_kernel


@dataclass(frozen=True)
class Sample:
    """Particles at the start: fluid positions [m] and velocities [m/s], (N, dim), one mass [kg], and the walls.

    Wall particles have positions [m], (M, dim), and volumes [m^dim], (M,).
    """

    positions: np.ndarray
    velocities: np.ndarray
    mass: float
    wall_positions: np.ndarray
    wall_volumes: np.ndarray


def sample(scene: Scene) -> Sample:
    """Fill the scene's blocks with a lattice and line its walls."""
    positions = [fill_block(scene, block) for block in scene.fluids]
    velocities = [
        np.tile(np.asarray(block.velocity or (0.0,) * scene.dim), (len(x), 1))
        for block, x in zip(scene.fluids, positions, strict=True)
    ]
    wall_positions, wall_volumes = line_walls(scene)
    return Sample(
        np.concatenate(positions), np.concatenate(velocities), calibrate_mass(scene), wall_positions, wall_volumes
    )


def calibrate_mass(scene: Scene) -> float:
    """Particle mass [kg] that gives the infinite initial lattice its rest density: m = rho_0 / sum_j W_ij.

    With m = rho_0 s^dim a Wendland lattice at r = 2s starts several percent too dense and explodes.
    """
    kernel = make_kernel(scene.kernel, scene.dim, scene.support)
    return scene.rest_density / lattice_sum(kernel, scene.dim, scene.spacing)


def fill_block(scene: Scene, block: Block) -> np.ndarray:
    """Positions [m], (N, dim), of a lattice of the scene's spacing whose cells all lie inside the block.

    A size that is no multiple of the spacing leaves a gap of less than one spacing, never an overlap: the lattice sits
    at the face that touches a wall of the domain (the lower one if both or none do), so that it rests there.
    """
    axes = []
    for a, b, low, high in zip(block.lower, block.upper, scene.domain.lower, scene.domain.upper, strict=True):
        count = max(1, math.floor((b - a) / scene.spacing * (1 + 1e-9) + 1e-6))
        tolerance = 1e-6 * scene.spacing
        at_upper_wall = abs(b - high) < tolerance and abs(a - low) >= tolerance
        start = b - count * scene.spacing if at_upper_wall else a
        axes.append(start + (np.arange(count) + 0.5) * scene.spacing)
    return _product(axes)


def line_walls(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m], (M, dim), and volumes [m^dim], (M,), of wall particles outside each face of the domain.

    As many layers as the support radius can see continue the fluid's lattice, so that fluid resting on a wall has its
    rest density; along a face the spacing is adapted so that a whole number fits.
    """
    if not scene.walls:
        return np.zeros((0, scene.dim)), np.zeros(0)
    s = scene.spacing
    layers = math.ceil(scene.support_ratio - 0.5 - 1e-9)
    outside = (np.arange(layers) + 0.5) * s
    inner, inner_width, full, full_width = [], [], [], []
    for low, high in zip(scene.domain.lower, scene.domain.upper, strict=True):
        count = max(1, round((high - low) / s))
        width = (high - low) / count
        inner.append(low + (np.arange(count) + 0.5) * width)
        inner_width.append(np.full(count, width))
        full.append(np.concatenate([low - outside[::-1], inner[-1], high + outside]))
        full_width.append(np.concatenate([np.full(layers, s), inner_width[-1], np.full(layers, s)]))
    positions, volumes = [], []
    for axis in range(scene.dim):  # the two faces across `axis`; earlier axes' faces own the edges they share
        ends = np.r_[0:layers, -layers:0]
        rest = slice(axis + 1, None)
        positions.append(_product([*inner[:axis], full[axis][ends], *full[rest]]))
        volumes.append(_product([*inner_width[:axis], full_width[axis][ends], *full_width[rest]]).prod(axis=1))
    return np.concatenate(positions), np.concatenate(volumes)


def _product(axes: list[np.ndarray]) -> np.ndarray:
    """All combinations of the axes' values, (N, dim), the last axis fastest."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
