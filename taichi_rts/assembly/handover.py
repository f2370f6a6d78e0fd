"""Going on with another stepper: the present state of one simulation becomes that of another of the same scene."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from taichi_rts.assembly.work import Tally
from taichi_rts.device.backend import ti
from taichi_rts.simulation import Simulation
from taichi_rts.solver.physics.timetable import LAST
from taichi_rts.solver.stepping.base import Stepper


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """What any stepper needs to go on from `time` [s], in host memory; arrays are in order of the stable `ids`, (N,).

    Accelerations and steps are not in it: as at the start, everybody is due in the first step.

    Attributes:
        positions, velocities: (N, dim) [m], counted from `Simulation.origin`, and [m/s].
        densities: (N,) [kg/m^3].
        guided_until: (N,) times [s] until which an inflow prescribes the velocity, where there is one.
        sound: sound speeds [m/s] and reference densities [kg/m^3], (2, N), where the sound speed is regional.
        born: how many ids have been given.
        layers: how many layers each inflow has let in; `entered` is their energy [J].
        removed: how many particles each outlet has taken out; `left` is their energy and the work done on them, (2,) [J].
        gravity_work: energy [J] that changes of gravity have put in.
    """

    time: float
    ids: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    densities: np.ndarray
    guided_until: np.ndarray | None
    sound: np.ndarray | None
    born: int
    layers: tuple[int, ...]
    entered: float
    removed: tuple[int, ...]
    left: tuple[float, float]
    gravity_work: float

    @classmethod
    def of(cls, sim: Simulation) -> Snapshot:
        """Return that of `sim` at its present time."""
        x, v, rho, _ = sim.local_state()
        p, inflows, outlets = sim.particles, sim.inflows, sim.outlets
        return cls(
            time=sim.time,
            ids=sim.ids(),
            positions=x,
            velocities=v,
            densities=rho,
            guided_until=p.to_numpy(p.guided_until) * sim.timeline.tick if p.has_guide else None,
            sound=np.stack([p.to_numpy(p.sound), p.to_numpy(p.reference)]) if p.has_sound else None,
            born=p.born,
            layers=tuple(inflows.done) if inflows else (),
            entered=inflows.energy if inflows else 0.0,
            removed=tuple(outlets.removed) if outlets else (),
            left=(outlets.energy, outlets.work) if outlets else (0.0, 0.0),
            gravity_work=sim._gravity_work,
        )

    def put_into(self, sim: Simulation) -> None:
        """Let `sim`, of the same scene, go on from here; `time` has to be a tick of its clock.

        Its statistics begin anew. Debug runs begin their budgets anew too.
        """
        now = round(self.time / sim.timeline.tick)
        sim.timeline.now, sim._time, sim._gravity_work = now, self.time, self.gravity_work
        self._fill(sim, now)
        if sim.inflows:
            sim.inflows.done, sim.inflows.energy = list(self.layers), self.entered
        if sim.outlets:
            sim.outlets.removed = list(self.removed)
            sim.outlets.energy, sim.outlets.work = self.left
            sim.outlets.looks = 0
        sim.solver.sorts = 0
        sim.grid.order.from_numpy(np.arange(sim.particles.capacity, dtype=np.int32))
        sim.grid.forget()
        sim.schedule.read_at.fill(0)
        for counter in (
            sim.motion.stopped,
            sim.motion.stopped_by_obstacles,
            sim.motion.not_finite,
            sim.motion.runaways,
        ):
            counter.clear()
        sim.schedule.restart(now)
        sim._tally = Tally(sim.schedule.levels, base_steps=sim.schedule.steps)
        sim.start()

    def _fill(self, sim: Simulation, now: int) -> None:
        """Write the particles' fields: those that are there, then those that inflows may bring, then those that are gone."""
        p = sim.particles
        count, gone = len(self.ids), np.setdiff1d(np.arange(self.born), self.ids)
        p.count, p.born = count, self.born
        p.alive[None] = count
        for field in p.reals:
            field.fill(0)

        def put(field: Any, values: Any, rest: float = 0) -> None:
            whole = field.to_numpy()
            whole[:count], whole[count:] = values, rest
            field.from_numpy(whole)

        put(p.x, self.positions)
        put(p.v, self.velocities)
        put(p.rho, self.densities, sim.scene.rest_density)
        put(p.updated, np.full(count, now, np.int32))
        p.identity.from_numpy(np.concatenate([self.ids, np.arange(self.born, p.capacity), gone]).astype(np.int32))
        if self.guided_until is not None:
            until = np.ceil(self.guided_until / sim.timeline.tick * (1.0 - 1e-12))
            put(p.guided_until, np.minimum(until, LAST).astype(np.int32))
        if p.has_viscosity:
            own = np.full(self.born, sim.scene.viscosities[-1])
            own[: len(sim.start_viscosities)] = sim.start_viscosities
            put(p.viscosity, own[self.ids])
        if sim.sound:
            for field in vars(sim.sound).values():
                if isinstance(field, ti.Field):
                    field.fill(0)
            sound, reference = (sim.sound.floor, sim.scene.rest_density) if self.sound is None else self.sound
            put(p.sound, sound, sim.sound.floor)
            put(p.reference, reference, sim.scene.rest_density)


def change_stepper(sim: Simulation, stepper: Stepper, **changes: Any) -> Simulation:
    """Return a simulation that goes on from the present state of `sim` with another `stepper`.

    `changes` replace fields of its scene that fluid and walls do not depend on, such as `kinematic_viscosity`. The time is
    moved on to the next tick of the new stepper's clock. Raises `StepperError` or `SceneError`.
    """
    other = Simulation(sim.scene.replace(**changes), stepper, debug=sim.schedule.debug)
    hand_over(sim, other)
    return other


def hand_over(sim: Simulation, other: Simulation) -> None:
    """Let `other`, a simulation of the same scene, go on from the present state of `sim`, which is moved on to its next tick."""
    tick = other.timeline.tick
    sim.advance_to(max(sim.time, math.ceil(sim.time / tick * (1.0 - 1e-12)) * tick))
    Snapshot.of(sim).put_into(other)
