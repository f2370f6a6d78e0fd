"""Small problems that share a tank, a number of particles and a sound speed, so that they share compiled kernels."""

from dataclasses import dataclass, field

import numpy as np

import taichi_rts as rts
from taichi_rts.solver.stepping import steppers

FALL_VELOCITY = (0.1, -0.5)
THROW = (1.0, 0.5)
STRAIN = rts.LinearField(((4.0, 0.0), (0.0, -4.0)), value=THROW, origin=(0.4, 0.5))


@dataclass(frozen=True)
class Problem:
    scene: rts.Scene
    end_time: float
    pieces: int = 7


def tank_2d(*fluids, **changes):
    fields = {"domain": rts.Box((0, 0), (1, 1)), "fluids": fluids, "spacing": 0.04, "sound_speed": 40.0}
    return rts.Scene(**(fields | changes))


def tank_3d(*fluids):
    return rts.Scene(domain=rts.Box((0, 0, 0), (0.6, 0.6, 0.3)), fluids=fluids, spacing=0.06, sound_speed=30.0)


PROBLEMS = {
    "dam_break_2d": Problem(tank_2d(rts.Block((0, 0), (0.4, 0.8))), 0.12),
    "dam_break_3d": Problem(tank_3d(rts.Block((0, 0, 0), (0.24, 0.48, 0.3))), 0.08),
    "still_pool": Problem(tank_2d(rts.Block((0, 0), (1, 0.32))), 0.1),
    "free_fall": Problem(tank_2d(rts.Block((0.1, 0.5), (0.9, 0.9), velocity=FALL_VELOCITY)), 0.12),
    "head_on_blobs": Problem(
        tank_2d(
            rts.Block((0.08, 0.3), (0.48, 0.7), velocity=(3, 0)),
            rts.Block((0.52, 0.3), (0.92, 0.7), velocity=(-3, 0)),
            gravity=(0, 0),
        ),
        0.08,
    ),
    "drop_in_flight": Problem(tank_2d(rts.Block((0.2, 0.1), (0.6, 0.9), velocity=STRAIN)), 0.12),
}

STEPPERS = {
    "uniform_serna": rts.Uniform(),
    "uniform_symplectic_euler": rts.Uniform(integrator="symplectic_euler"),
    "uniform_adaptive": rts.Uniform(adaptive=True),
    "regional": rts.Regional(),
    "regional_paper": rts.Regional(preset="paper"),
    "regional_graded": rts.Regional(levels=5, courant=0.2, grading=True, inactive_density="extrapolated"),
    "asynchronous": rts.Asynchronous(),
    "asynchronous_integers": rts.Asynchronous(steps="integers", levels=16, stagger=1),
}
STEPPERS |= {name: kind() for name, kind in steppers.STEPPERS.items() if kind not in map(type, STEPPERS.values())}
"""All steppers: those that nothing is said of above at their defaults."""

IN_2D_ONLY = ("uniform_symplectic_euler", "uniform_adaptive", "regional", "asynchronous")
"""Of each kind others run in three dimensions; the defaults do so in tests/validation/test_still_pool.py."""


@dataclass
class Record:
    problem: Problem
    base_step: float
    times: list = field(default_factory=list)
    states: list = field(default_factory=list)
    energies: list = field(default_factory=list)
    momenta: list = field(default_factory=list)
    ends: list = field(default_factory=list)
    cells: list = field(default_factory=list)
    statistics: dict = field(default_factory=dict)


def record(problem, stepper):
    """Run a problem in pieces that end at odd times, and keep all that can be seen from outside."""
    sim = rts.Simulation(problem.scene, stepper, debug=True)
    seen = Record(problem, sim.base_step)
    for time in np.linspace(0, problem.end_time, problem.pieces + 1):
        sim.advance_to(time)
        seen.times.append((time, sim.time))
        seen.states.append(sim.state())
        seen.energies.append(sim.energy().total)
        seen.momenta.append(sim.momentum())
        seen.ends.append(by_id(sim, sim.particles.updated, sim.particles.level))
        if stepper.name == "asynchronous":
            seen.cells.append(lead_of_neighbours(sim))
    seen.statistics = sim.statistics
    return seen


def by_id(sim, *fields):
    """Values of fields, stacked, in order of particle id."""
    order = np.argsort(sim.particles.identity.to_numpy())
    return np.stack([field.to_numpy()[order] for field in fields])


def lead_of_neighbours(sim):
    """Largest number of ticks by which a cell is ahead of a neighbour, and the youngest cell's time."""
    time, empty = sim.schedule.time.to_numpy().astype(np.int64), sim.schedule.EMPTY
    ahead = 0
    for stride in sim.grid.geometry.neighbour_strides:
        other = np.roll(time, -stride)
        both = (time < empty) & (other < empty)
        ahead = max(ahead, (time - other)[both].max(initial=0))
    return ahead, time.min()


def blocks_with_levels(scene, x, levels):
    """Level of each block that holds particles; those that stand too close to a face to say which are left out."""
    place = (x - np.array(scene.domain.lower)) / scene.support
    clear = (np.abs(place - np.round(place)) > 1e-3).all(axis=1)
    found = {}
    for block, level in zip(map(tuple, np.floor(place[clear]).astype(int)), levels[clear], strict=True):
        found.setdefault(block, set()).add(int(level))
    return found


def around(block, found):
    offsets = np.ndindex(*[3] * len(block))
    places = (tuple(b + o - 1 for b, o in zip(block, offset, strict=True)) for offset in offsets)
    return [place for place in places if place in found]
