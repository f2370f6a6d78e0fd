"""From a scene to particles: pure functions on NumPy arrays, before anything runs on a device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from taichi_rts.medium.equation_of_state import Tait
from taichi_rts.medium.smoothing import lattice_sum, make_kernel
from taichi_rts.sampling.walls import WallLayer, line_obstacles, line_walls, product
from taichi_rts.scene.geometry.making import make_solid
from taichi_rts.scene.geometry.solid import Solid
from taichi_rts.scene.parts.conditions import Inflow
from taichi_rts.scene.parts.particles import Particles
from taichi_rts.scene.parts.shapes import Block, Sphere, velocities
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


def sample(scene: Scene) -> Sample:
    """Fill the scene's fluids with a lattice, but not where obstacles are, and line its walls and obstacles."""
    solids = [make_solid(obstacle, scene.spacing, scene.domain) for obstacle in scene.obstacles]
    positions = [keep_outside(scene, solids, fill(scene, fluid)) for fluid in scene.fluids]
    moving = [velocities(fluid, x) for fluid, x in zip(scene.fluids, positions, strict=True)]
    pressed = [compress(scene, fluid, x) for fluid, x in zip(scene.fluids, positions, strict=True)]
    viscosities = [np.full(len(x), nu) for x, nu in zip(positions, scene.viscosities, strict=False)]
    return Sample(
        np.concatenate([x for x, _ in pressed]),
        np.concatenate(moving),
        np.concatenate([rho for _, rho in pressed]),
        np.concatenate(viscosities),
        np.repeat(np.arange(len(positions), dtype=np.int32), [len(x) for x in positions]),
        calibrate_mass(scene),
        *line_walls(scene),
        line_obstacles(scene, solids),
    )


def compress(scene: Scene, fluid: Block | Sphere | Particles, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
    return fill_block(scene, Block(tuple(lower), tuple(upper)))


def calibrate_mass(scene: Scene) -> float:
    """Particle mass [kg] that gives the infinite initial lattice its rest density: m = rho_0 / sum_j W_ij.

    With m = rho_0 s^dim a Wendland lattice at r = 2s starts several percent too dense and explodes.
    """
    kernel = make_kernel(scene.kernel, scene.dim, scene.support)
    return scene.rest_density / lattice_sum(kernel, scene.dim, scene.spacing)


def fill(scene: Scene, fluid: Block | Sphere | Particles) -> np.ndarray:
    """Positions [m], (N, dim), of a fluid's particles."""
    if isinstance(fluid, Particles):
        return np.clip(fluid.positions, scene.domain.lower, scene.domain.upper)  # rounding may have put one beyond
    return fill_sphere(scene, fluid) if isinstance(fluid, Sphere) else fill_block(scene, fluid)


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
    return product(axes)


def fill_sphere(scene: Scene, sphere: Sphere) -> np.ndarray:
    """Positions [m], (N, dim), of a lattice of the scene's spacing that lie inside the sphere.

    The lattice's cells meet at the centre, so it has the centre's mirror symmetries. A cell counts whole if its middle is
    inside, so the surface is a staircase, but N s^dim is the volume to within a few cells.
    """
    count = math.ceil(sphere.radius / scene.spacing)
    offsets = product([(np.arange(-count, count) + 0.5) * scene.spacing] * scene.dim)
    inside = np.linalg.norm(offsets, axis=1) <= sphere.radius * (1 + 1e-9)
    return np.asarray(sphere.centre) + offsets[inside]


def keep_outside(scene: Scene, solids: Sequence[Solid], x: np.ndarray) -> np.ndarray:
    """Leave out of `x` [m], (N, dim), what lies in an obstacle or nearer to it than half a spacing, as at the walls."""
    for solid in solids:
        x = x[solid.distance(x) >= (0.5 - 1e-3) * scene.spacing]
    return x
