"""From a scene to particles: pure functions on NumPy arrays, before anything runs on a device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from taichi_rts.medium.equation_of_state import Tait
from taichi_rts.medium.smoothing import lattice_sum, make_kernel
from taichi_rts.sampling.faces import line_walls, no_walls
from taichi_rts.sampling.walls import WallLayer, line_obstacles
from taichi_rts.scene.fluids.block import Block
from taichi_rts.scene.fluids.particles import Particles
from taichi_rts.scene.fluids.shape import FluidShape
from taichi_rts.scene.geometry.spanning import scene_solid
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.parts.conditions import Inflow
from taichi_rts.scene.rows import Rows, fit_rows, is_multiple
from taichi_rts.scene.scene import Scene
from taichi_rts.scene.validation import Vector

WIDEST_ROWS = 1.25
"""Largest distance [spacings] of rows on the patch of an inflow."""


@dataclass(frozen=True)
class Sample:
    """Particles at the start: positions [m] and velocities [m/s], (N, dim), densities [kg/m^3], viscosities [m^2/s], (N,).

    `fluids`, (N,), is the place of each particle's fluid in the scene. All have one mass [kg]. `walls` are the wall particles,
    (M,), and `owners`, (M,), the number of the moving wall that each is part of, -1 for those at rest. `obstacles` are the wall
    particles of each obstacle, as it stands at time 0.
    """

    positions: np.ndarray
    velocities: np.ndarray
    densities: np.ndarray
    viscosities: np.ndarray
    fluids: np.ndarray
    mass: float
    walls: WallLayer
    owners: np.ndarray
    obstacles: tuple[WallLayer, ...] = ()


def sample(scene: Scene, *, walls: bool = True) -> Sample:
    """Fill the scene's fluids with a lattice, but not where obstacles are, and line its obstacles and, if asked, its walls."""
    rows = fit_rows(scene)
    solids = [scene_solid(scene, obstacle) for obstacle in scene.obstacles]
    positions = fill(scene, rows, solids)
    moving = [fluid.velocities_at(x) for fluid, x in zip(rows.fluids, positions, strict=True)]
    pressed = [compress(scene, fluid, x) for fluid, x in zip(rows.fluids, positions, strict=True)]
    viscosities = [np.full(len(x), nu) for x, nu in zip(positions, scene.viscosities, strict=False)]
    return Sample(
        np.concatenate([x for x, _ in pressed]),
        np.concatenate(moving),
        np.concatenate([rho for _, rho in pressed]),
        np.concatenate(viscosities),
        np.repeat(np.arange(len(positions), dtype=np.int32), [len(x) for x in positions]),
        calibrate_mass(scene),
        *(line_walls(scene) if walls else no_walls(scene)),
        line_obstacles(scene, solids),
    )


def fluid_positions(scene: Scene) -> list[np.ndarray]:
    """Positions [m], (N, dim) each, of the lattice of every fluid."""
    return fill(scene, fit_rows(scene), [scene_solid(scene, obstacle) for obstacle in scene.obstacles])


def fill(scene: Scene, rows: Rows, solids: Sequence[Solid]) -> list[np.ndarray]:
    """Positions [m], (N, dim) each, of every fluid on the lattice `rows`, outside the `solids` of the scene's obstacles."""
    return [keep_outside(scene, solids, fluid.fill(rows.steps, scene.domain)) for fluid in rows.fluids]


def compress(scene: Scene, fluid: FluidShape, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions `x` [m], (N, dim), and densities [kg/m^3], (N,), under the hydrostatic pressure of the fluid's own column.

    p = rho_0 g (H - z), and every layer sinks by what those below it give way: g (H z - z^2/2)/c_s^2 at height z over the
    fluid's lowest point. Without `Scene.hydrostatic` all stays as it is, as do
    particles that are given one by one.
    """
    rest = np.full(len(x), scene.rest_density)
    if isinstance(fluid, Particles):
        return x, rest if fluid.densities is None else fluid.densities
    g = math.hypot(*scene.acceleration)
    if not scene.hydrostatic or g == 0.0:
        return x, rest
    up = -np.asarray(scene.acceleration) / g
    height = fluid.reach(tuple(up)) + fluid.reach(tuple(-up))
    z = x @ up + fluid.reach(tuple(-up))
    sound = scene.least_wave_speed  # at which all begin where it is regional
    state = Tait(scene.rest_density, sound)
    sinking = g / sound**2 * (height * z - 0.5 * z * z)
    return x - sinking[:, None] * up, state.density(scene.rest_density * g * (height - z))


def fill_patch(scene: Scene, inflow: Inflow) -> np.ndarray:
    """Positions [m], (N, dim), of the layer of particles that an inflow lets in at once, on its patch, in `patch_steps`."""
    steps = np.array(patch_steps(scene, inflow))
    half = 0.5 * steps[inflow.axis] * np.eye(scene.dim)[inflow.axis]
    lower, upper = np.asarray(inflow.lower) - half, np.asarray(inflow.upper) + half
    return Block(tuple(lower), tuple(upper)).fill(tuple(steps.tolist()), scene.domain)


def patch_steps(scene: Scene, inflow: Inflow) -> Vector:
    """Distances [m], (dim,), of rows on an inflow's patch, and of its layers across it.

    A whole number of rows fits into the patch, and layers follow each other such that a particle has the volume that those at the
    start have: so area times speed flows in. Rows are no further apart than `WIDEST_ROWS`, where but one fits.
    """
    rows = fit_rows(scene)
    steps = list(rows.steps)
    sides = [d for d in range(scene.dim) if d != inflow.axis]
    for d in sides:
        length = inflow.upper[d] - inflow.lower[d]
        if not is_multiple(length, steps[d]):
            fitted = length / max(1, math.floor(length / scene.spacing + 0.5))
            steps[d] = min(fitted, WIDEST_ROWS * scene.spacing)
    if tuple(steps) != rows.steps:
        steps[inflow.axis] = rows.cell / math.prod(steps[d] for d in sides)
    return tuple(steps)


def calibrate_mass(scene: Scene) -> float:
    """Particle mass [kg] that gives the infinite initial lattice its rest density: m = rho_0 / sum_j W_ij, on `rows.fit_rows`.

    With m = rho_0 s^dim a Wendland lattice at r = 2s starts several percent too dense and explodes.
    """
    kernel = make_kernel(scene.kernel, scene.dim, scene.support)
    return scene.rest_density / lattice_sum(kernel, fit_rows(scene).steps)


def keep_outside(scene: Scene, solids: Sequence[Solid], x: np.ndarray) -> np.ndarray:
    """Leave out of `x` [m], (N, dim), what lies in an obstacle or nearer to it than half a spacing, as at the walls."""
    low, high = np.array(scene.domain.lower), np.array(scene.domain.upper)
    around = np.array(scene.is_periodic)
    for solid in solids:
        y = x
        crossed = around & ((solid.lower < low) | (solid.upper > high))
        if crossed.any():  # a moving body: what lies nearest to it of the images of x
            lengths = np.where(crossed, high - low, 1.0)
            y = x - crossed * lengths * np.round((x - solid.middle) / lengths)
        near = np.asarray(((y > solid.lower - scene.spacing) & (y < solid.upper + scene.spacing)).all(axis=1))
        near[near] = solid.distance(y[near]) < (0.5 - 1e-3) * scene.spacing
        x = x[~near]
    return x
