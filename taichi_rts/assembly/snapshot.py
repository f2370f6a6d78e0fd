"""The state of a run as any stepper can take it up: to go on with another one, or to go back to the start."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from taichi_rts.assembly.run import Run
from taichi_rts.device.backend import ti
from taichi_rts.solver.physics.timetable import LAST


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """What any stepper needs to go on from `time` [s], in host memory; arrays are in order of the stable `ids`, (N,).

    Accelerations and steps are not in it: as at the start, all particles are due in the first step.

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
    def of(
        cls, run: Run, state: tuple[np.ndarray, np.ndarray, np.ndarray], ids: np.ndarray, gravity_work: float
    ) -> Snapshot:
        """Return that of `run` at its present time, when it has this `state`: positions, velocities and densities."""
        p, inflows, outlets = run.particles, run.inflows, run.outlets
        return cls(
            time=run.time,
            ids=ids,
            positions=state[0],
            velocities=state[1],
            densities=state[2],
            guided_until=p.to_numpy(p.guided_until) * run.timeline.tick if p.has_guide else None,
            sound=np.stack([p.to_numpy(p.sound), p.to_numpy(p.reference)]) if p.has_sound else None,
            born=p.born,
            layers=tuple(inflows.done) if inflows else (),
            entered=inflows.energy if inflows else 0.0,
            removed=tuple(outlets.removed) if outlets else (),
            left=(outlets.energy, outlets.work) if outlets else (0.0, 0.0),
            gravity_work=gravity_work,
        )

    def put_into(self, run: Run) -> None:
        """Give this state to the parts of `run`, of the same scene; `time` has to be a tick of its clock."""
        now = round(self.time / run.timeline.tick)
        run.timeline.now = now
        self._fill(run, now)
        if run.inflows:
            run.inflows.done, run.inflows.energy = list(self.layers), self.entered
        if run.outlets:
            run.outlets.removed = list(self.removed)
            run.outlets.energy, run.outlets.work = self.left
            run.outlets.looks = 0
        run.grid.order.from_numpy(np.arange(run.particles.capacity, dtype=np.int32))
        run.grid.forget()
        run.schedule.read_at.fill(0)
        for counter in (
            run.motion.stopped,
            run.motion.stopped_by_obstacles,
            run.motion.not_finite,
            run.motion.runaways,
        ):
            counter.clear()
        run.schedule.restart(now)

    def _fill(self, run: Run, now: int) -> None:
        """Write the particles' fields: those that are there, then those that inflows may bring, then those that are gone."""
        p = run.particles
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
        put(p.rho, self.densities, run.scene.rest_density)
        put(p.updated, np.full(count, now, np.int32))
        p.identity.from_numpy(np.concatenate([self.ids, np.arange(self.born, p.capacity), gone]).astype(np.int32))
        if self.guided_until is not None:
            until = np.ceil(self.guided_until / run.timeline.tick * (1.0 - 1e-12))
            put(p.guided_until, np.minimum(until, LAST).astype(np.int32))
        if p.has_viscosity:
            own = np.full(self.born, run.scene.viscosities[-1])
            own[: len(run.start_viscosities)] = run.start_viscosities
            put(p.viscosity, own[self.ids])
        if run.sound:
            for field in vars(run.sound).values():
                if isinstance(field, ti.Field):
                    field.fill(0)
            sound, reference = (run.sound.floor, run.scene.rest_density) if self.sound is None else self.sound
            put(p.sound, sound, run.sound.floor)
            put(p.reference, reference, run.scene.rest_density)
