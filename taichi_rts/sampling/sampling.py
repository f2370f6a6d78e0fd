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
from taichi_rts.scene.obstacles.making import make_solid
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.parts.conditions import Inflow
from taichi_rts.scene.scene import Scene


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
    solids = [make_solid(obstacle, scene.spacing, scene.domain) for obstacle in scene.obstacles]
    positions = fluid_positions(scene, solids)
    moving = [fluid.velocities_at(x) for fluid, x in zip(scene.fluids, positions, strict=True)]
    pressed = [compress(scene, fluid, x) for fluid, x in zip(scene.fluids, positions, strict=True)]
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


def fluid_positions(scene: Scene, solids: Sequence[Solid] | None = None) -> list[np.ndarray]:
    """Positions [m], (N, dim) each, of the lattice of every fluid; `solids` are those of the scene's obstacles."""
    if solids is None:
        solids = [make_solid(obstacle, scene.spacing, scene.domain) for obstacle in scene.obstacles]
    return [keep_outside(scene, solids, fluid.fill(scene.spacing, scene.domain)) for fluid in scene.fluids]


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
    """Positions [m], (N, dim), of the layer of particles that an inflow lets in at once, on its patch."""
    half = 0.5 * scene.spacing * np.eye(scene.dim)[inflow.axis]
    lower, upper = np.asarray(inflow.lower) - half, np.asarray(inflow.upper) + half
    return Block(tuple(lower), tuple(upper)).fill(scene.spacing, scene.domain)


def calibrate_mass(scene: Scene) -> float:
    """Particle mass [kg] that gives the infinite initial lattice its rest density: m = rho_0 / sum_j W_ij.

    With m = rho_0 s^dim a Wendland lattice at r = 2s starts several percent too dense and explodes.
    """
    kernel = make_kernel(scene.kernel, scene.dim, scene.support)
    return scene.rest_density / lattice_sum(kernel, scene.dim, scene.spacing)


def keep_outside(scene: Scene, solids: Sequence[Solid], x: np.ndarray) -> np.ndarray:
    """Leave out of `x` [m], (N, dim), what lies in an obstacle or nearer to it than half a spacing, as at the walls."""
    for solid in solids:
        near = np.asarray(((x > solid.lower - scene.spacing) & (x < solid.upper + scene.spacing)).all(axis=1))
        near[near] = solid.distance(x[near]) < (0.5 - 1e-3) * scene.spacing
        x = x[~near]
    return x
