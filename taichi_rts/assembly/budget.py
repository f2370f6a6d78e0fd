"""Where a run's energy and momentum come from: what has worked on it, and what no outer force accounts for."""

from __future__ import annotations

import numpy as np

from taichi_rts.assembly.run import Run
from taichi_rts.device.ownership import guarded
from taichi_rts.errors import Error


@guarded("keeps_work", "keeps_momentum_budget")
class Budget(Run):
    """What `Simulation` knows of its energy and momentum; with moving things only in a debug run, whose particles keep books."""

    initial_momentum: np.ndarray

    @property
    def keeps_work(self) -> bool:
        """Whether `work` is known."""
        return self.particles.has_budget or not (self.motion.momentum.moving or self.inflows)

    def work(self) -> float:
        """Energy [J] that changes of gravity, moving walls, moving obstacles and inflows have put in until `time`.

        What flows in brings its kinetic and potential energy, what flows out takes its own along. Moving things and inflows
        need a debug run, else raises `Error`.
        """
        if not self.keeps_work:
            raise Error("the work of moving walls, moving obstacles and inflows needs Simulation(..., debug=True)")
        total, p = self.gravity_work, self.particles
        if self.motion.momentum.moving or self.inflows:
            elapsed = self.time - p.to_numpy(p.updated) * self.timeline.tick
            done = p.to_numpy(p.work).astype(float) + elapsed * p.to_numpy(p.power)
            total += self.medium.mass * float(done.sum())
        return total + sum(extra.energy_brought() for extra in self.solver.extras)

    def sound_work(self) -> float:
        """Energy [J] that changes of the regional sound speed and of reference densities have put in; negative if taken out.

        A particle that becomes stiffer under the same pressure holds less energy. Needs a debug run, else raises `Error`.
        """
        if self.sound is None:
            return 0.0
        if not self.particles.has_budget:
            raise Error("the work of changes of the sound speed needs Simulation(..., debug=True)")
        return self.medium.mass * float(self.particles.to_numpy(self.particles.sound_work).astype(float).sum())

    @property
    def keeps_momentum_budget(self) -> bool:
        """Whether `momentum_drift` can say anything."""
        scene, own = self.scene, self.motion.momentum.own_bodies.bodies
        unknown = scene.body_force or scene.gravity_changes or scene.inflows or scene.outlets or own
        return self.particles.has_budget and not unknown

    def momentum_drift(self) -> np.ndarray:
        """Momentum [kg m/s], (dim,), that no outer force accounts for: what was gained less gravity's and the walls' share.

        Zero to rounding with uniform steps, where partners push each other equally at the same time. Needs a debug run and a
        scene without body forces, changes of gravity, inflows and outlets, else raises `Error`.
        """
        if not self.keeps_momentum_budget:
            raise Error(
                "the momentum budget needs Simulation(..., debug=True), "
                "and a scene without body_force, gravity_changes, inflows and outlets"
            )
        p = self.particles
        elapsed = self.time - p.updated.to_numpy() * self.timeline.tick
        walls = p.wall_push.to_numpy().astype(float) + elapsed[:, None] * p.a_walls.to_numpy()
        if p.has_past and (ahead := elapsed < 0.0).any():  # whose velocity is interpolated between two evaluations
            step = (p.updated.to_numpy() - p.past_updated.to_numpy())[ahead] * self.timeline.tick
            share = (-elapsed[ahead] / step)[:, None]
            now, before = (field.to_numpy()[ahead].astype(float) for field in (p.wall_push, p.past_wall_push))
            walls[ahead] = now + share * (before - now)
        gravity = p.count * self.time * np.asarray(self.scene.acceleration)
        gained = self.momentum() - self.initial_momentum
        return gained - self.medium.mass * (walls.sum(axis=0) + gravity)

    def momentum(self) -> np.ndarray:
        """Total momentum [kg m/s], (dim,), at `time`."""
        raise NotImplementedError
