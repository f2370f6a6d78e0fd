"""The state of a run as any stepper can take it up: to go on with another one, or to go back to the start."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from taichi_rts.assembly.run import Run


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """What any stepper needs to go on from `time` [s], in host memory; arrays are in order of the stable `ids`, (N,).

    Accelerations and steps are not in it: as at the start, all particles are due in the first step.

    Attributes:
        positions, velocities: (N, dim) [m], counted from `Simulation.origin`, and [m/s].
        densities: (N,) [kg/m^3].
        born: how many ids have been given.
        gravity_work: energy [J] that changes of gravity have put in.
        extras: what `Extra.kept` of each extra says, by the name of its class.
    """

    time: float
    ids: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    densities: np.ndarray
    born: int
    gravity_work: float
    extras: dict[str, Any]

    @classmethod
    def of(cls, run: Run, state: tuple[np.ndarray, np.ndarray, np.ndarray], ids: np.ndarray) -> Snapshot:
        """Return that of `run` at its present time, when it has this `state`: positions, velocities and densities."""
        kept = {type(extra).__name__: extra.kept(run.timeline.tick) for extra in run.solver.extras}
        return cls(run.time, ids, *state, run.particles.born, run.gravity_work, kept)

    def put_into(self, run: Run) -> None:
        """Give this state to the parts of `run`, of the same scene; `time` has to be a tick of its clock."""
        now = round(self.time / run.timeline.tick)
        run.timeline.now = now
        self._fill(run, now)
        for extra in run.solver.extras:
            extra.go_on(self.extras.get(type(extra).__name__), now, run.timeline.tick)
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
        p.put(p.x, self.positions)
        p.put(p.v, self.velocities)
        p.put(p.rho, self.densities, run.scene.rest_density)
        p.put(p.updated, np.full(count, now, np.int32))
        p.identity.from_numpy(np.concatenate([self.ids, np.arange(self.born, p.capacity), gone]).astype(np.int32))
        if p.has_viscosity:
            own = np.full(self.born, run.scene.viscosities[-1])
            own[: len(run.start_viscosities)] = run.start_viscosities
            p.put(p.viscosity, own[self.ids])
