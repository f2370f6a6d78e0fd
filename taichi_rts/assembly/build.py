"""From a scene and a stepper to the parts of a run: `assemble` makes each once, in the order in which they need each other."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from taichi_rts.assembly.following import begin_to_follow, follow, follows
from taichi_rts.assembly.inventory import parts
from taichi_rts.assembly.walls import make_keepers, make_walls
from taichi_rts.device.backend import Backend
from taichi_rts.medium.medium import Medium
from taichi_rts.sampling.sampling import Sample
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.tiles import Tiles
from taichi_rts.solver.grid.windows import FluidWindows, WallWindows
from taichi_rts.solver.motion.books import Books
from taichi_rts.solver.motion.inflow import Guide, Inflows, Patch
from taichi_rts.solver.motion.motion import Motion
from taichi_rts.solver.motion.observing import WallObserver
from taichi_rts.solver.motion.outlet import Outlets
from taichi_rts.solver.particles.extra import Extra
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.particles.past import Past
from taichi_rts.solver.physics.continuity import ContinuityDensity, DensityDiffusion, MirroredPressure
from taichi_rts.solver.physics.density import Density, SummationDensity
from taichi_rts.solver.physics.momentum import Gravity, MomentumEquation, Pressure
from taichi_rts.solver.physics.own_forces import OwnForces
from taichi_rts.solver.physics.timetable import Ticking
from taichi_rts.solver.physics.viscosity import viscosity_terms
from taichi_rts.solver.solver import Solver
from taichi_rts.solver.sound.floating_reference import FloatingReference
from taichi_rts.solver.sound.rule import SoundRule
from taichi_rts.solver.stepping.base import Stepper

DENSITIES: dict[str, type[Density]] = {"summation": SummationDensity, "continuity": ContinuityDensity}


def assemble(
    scene: Scene, stepper: Stepper, start: Sample, backend: Backend, own: OwnForces, *, debug: bool = False
) -> Solver:
    """Build the parts of a run of `scene`, whose coordinates are counted from its origin, from its particles at the `start`.

    `own` are the forces of a user's own. `memory.declared_fields` lists the fields of all parts that are made here.
    """
    timeline = stepper.timeline(scene)
    needs = optional_fields(scene, stepper, debug)
    patches = [Patch(scene, number) for number in range(len(scene.inflows))]
    particles = make_particles(scene, start, backend, needs, sum(patch.particles for patch in patches))
    geometry = make_tiles(scene, stepper, particles.capacity) if follows(scene) else make_geometry(scene, stepper)
    past = [Past(particles, geometry)] if particles.has_past else []
    grid = BlockGrid(geometry, particles.capacity, particles.alive)
    sound = SoundRule(scene, particles, grid) if particles.has_sound else None
    medium = make_medium(scene, start, particles, sound)
    near = Neighbourhood(particles.capacity, scene.dim, backend, needs, geometry)
    particles.borrow(near.spare, grid.rank)
    particles.carry(grid.cell_of)
    walls = make_walls(scene, start, near, grid, backend)
    windows = make_windows(scene, near, grid, walls, backend, needs)
    density = DENSITIES[scene.density](particles, near, grid, windows, walls, medium, backend, past)
    momentum = make_momentum(scene, particles, near, grid, windows, walls, medium, backend, own)
    motion = Motion(
        particles,
        near,
        grid,
        momentum,
        stepper.make_integrator(),
        medium,
        density,
        keepers=make_keepers(scene, geometry),
        past=past,
        guides=[Guide(particles)] if patches else [],
        books=[Books(particles, momentum)] if debug else [],
    )
    inflows = Inflows(scene, start.mass, patches, particles, past) if patches else None
    outlets = Outlets(scene, motion, start.mass) if scene.outlets else None
    schedule = stepper.schedule(scene, particles, grid, timeline)
    schedule.debug, schedule.sound = debug, sound
    observer = WallObserver(momentum.moving, grid) if momentum.moving else None
    extras: list[Extra] = [extra for extra in (inflows, outlets, sound, observer) if extra is not None]
    extras += follow(motion, grid, walls)  # last, when it is settled which particles there are
    solver = Solver(
        particles, near, grid, walls, medium, density, motion, timeline, schedule, inflows, outlets, sound, extras
    )
    solver.ticking = parts(solver, Ticking)
    solver.count_in(timeline.tick)
    begin_to_follow(solver, backend.dtype)
    return solver


def optional_fields(scene: Scene, stepper: Stepper, debug: bool) -> frozenset[str]:
    """Names of the fields of `FluidState` and `Neighbourhood` that only some runs need."""
    wanted = {
        "rho_rate": stepper.extrapolates_density,
        "past": stepper.keeps_past,
        "viscosity": len(set(scene.viscosities)) > 1,
        "guided_until": bool(scene.inflows),
        "sound": scene.regional_sound is not None,
        "budget": debug,
    }
    return DENSITIES[scene.density].needs | {name for name, needed in wanted.items() if needed}


def make_particles(scene: Scene, start: Sample, backend: Backend, needs: frozenset[str], unborn: int) -> FluidState:
    """Return the particles of the `start`, with room for `unborn` more."""
    particles = FluidState(
        start.positions,
        start.velocities,
        start.densities,
        scene.rest_density,
        backend,
        needs,
        len(start.positions) + unborn,
    )
    if particles.has_viscosity:
        particles.viscosity.from_numpy(np.pad(start.viscosities, (0, unborn)).astype(backend.numpy_dtype))
    return particles


def make_geometry(scene: Scene, stepper: Stepper, support: float | None = None) -> Geometry:
    """Return the blocks of the domain, wider than the support by what particles drift until the next sort.

    `support` [m] is the scene's, or that of another spacing.
    """
    support = support or scene.support
    return Geometry(scene.domain.lower, scene.domain.upper, support, stepper.drift * support, scene.is_periodic)


def make_tiles(scene: Scene, stepper: Stepper, particles: int) -> Tiles:
    """Return the same of which only blocks near the `particles` are kept."""
    support = scene.support
    return Tiles(scene.domain.lower, scene.domain.upper, support, stepper.drift * support, particles)


def make_medium(scene: Scene, start: Sample, particles: FluidState, sound: SoundRule | None) -> Medium:
    """Return the fluid's constants, with the equation of state that belongs to its sound speed."""
    medium = Medium.of(scene, start.mass)
    if sound is None:
        return medium
    return dataclasses.replace(medium, equation_of_state=FloatingReference(medium.equation_of_state, particles, sound))


def make_windows(
    scene: Scene,
    near: Neighbourhood,
    grid: BlockGrid,
    walls: list[Any],
    backend: Backend,
    needs: frozenset[str],
) -> FluidWindows | None:
    """Return the windows on the fluid that a CPU's threads copy from, and give walls at rest theirs."""
    if backend.arch != "cpu":
        return None
    per_block = math.prod(grid.geometry.sides) / scene.spacing**scene.dim
    windows = FluidWindows(near, grid, per_block, backend, needs)
    for wall in walls:
        if not wall.moves and not grid.geometry.repeats:  # whose images would need places of their own
            wall.windows = WallWindows(wall)
    return windows


def make_momentum(
    scene: Scene,
    particles: FluidState,
    near: Neighbourhood,
    grid: BlockGrid,
    windows: FluidWindows | None,
    walls: list[Any],
    medium: Medium,
    backend: Backend,
    own: OwnForces,
) -> MomentumEquation:
    """Return the momentum equation with the terms that the scene has, and forces of a user's own."""
    integrates = DENSITIES[scene.density].integrates
    gravity = Gravity(scene)
    return MomentumEquation(
        MirroredPressure(near, scene) if integrates else Pressure(near),
        viscosity_terms(scene, medium, near),
        near,
        grid,
        windows,
        walls,
        medium,
        gravity,
        backend,
        with_rho_rate=particles.has_rho_rate,
        diffusion=DensityDiffusion(medium, scene) if integrates else None,
        own=own,
    )
