"""Where a run's energy and momentum come from: what has worked on it, and what no outer force accounts for."""

from __future__ import annotations

import numpy as np

from taichi_rts.assembly.run import Run
from taichi_rts.errors import Error


def keeps_work(run: Run) -> bool:
    """Whether `work` is known."""
    return run.particles.has_budget or not (run.motion.moving_walls or run.inflows)


def work(run: Run, gravity_work: float) -> float:
    """Energy [J] that changes of gravity (`gravity_work`), moving walls, moving obstacles and inflows have put in so far.

    What flows in brings its kinetic and potential energy, what flows out takes its own along. Moving things and inflows
    need a debug run, else raises `Error`.
    """
    total, p = gravity_work, run.particles
    if run.motion.moving_walls or run.inflows:
        if not keeps_work(run):
            raise Error("the work of moving walls, moving obstacles and inflows needs Simulation(..., debug=True)")
        elapsed = run.time - p.to_numpy(p.updated) * run.timeline.tick
        done = p.to_numpy(p.work).astype(float) + elapsed * p.to_numpy(p.power)
        total += run.medium.mass * float(done.sum()) + (run.inflows.energy if run.inflows else 0.0)
    if run.outlets:
        total += run.outlets.work - run.outlets.energy
    return total


def sound_work(run: Run) -> float:
    """Energy [J] that changes of the regional sound speed and of reference densities have put in; negative if taken out.

    A particle that becomes stiffer under the same pressure holds less energy. Needs a debug run, else raises `Error`.
    """
    if run.sound is None:
        return 0.0
    if not run.particles.has_budget:
        raise Error("the work of changes of the sound speed needs Simulation(..., debug=True)")
    return run.medium.mass * float(run.particles.to_numpy(run.particles.sound_work).astype(float).sum())


def keeps_momentum_budget(run: Run) -> bool:
    """Whether `momentum_drift` can say anything."""
    scene = run.scene
    return run.particles.has_budget and not (
        scene.body_force
        or scene.gravity_changes
        or scene.inflows
        or scene.outlets
        or run.motion.momentum.own_bodies.bodies
    )


def momentum_drift(run: Run, gained: np.ndarray) -> np.ndarray:
    """Momentum [kg m/s], (dim,), that no outer force accounts for: what was `gained` less gravity's and the walls' share.

    Zero to rounding with uniform steps, where partners push each other equally at the same time. Needs a debug run and a
    scene without body forces, changes of gravity, inflows and outlets, else raises `Error`.
    """
    if not keeps_momentum_budget(run):
        raise Error(
            "the momentum budget needs Simulation(..., debug=True), "
            "and a scene without body_force, gravity_changes, inflows and outlets"
        )
    p = run.particles
    elapsed = run.time - p.updated.to_numpy() * run.timeline.tick
    walls = p.wall_push.to_numpy().astype(float) + elapsed[:, None] * p.a_walls.to_numpy()
    if p.has_past and (ahead := elapsed < 0.0).any():  # whose velocity is interpolated between two evaluations
        step = (p.updated.to_numpy() - p.past_updated.to_numpy())[ahead] * run.timeline.tick
        share = (-elapsed[ahead] / step)[:, None]
        now, before = (field.to_numpy()[ahead].astype(float) for field in (p.wall_push, p.past_wall_push))
        walls[ahead] = now + share * (before - now)
    gravity = p.count * run.time * np.asarray(run.scene.acceleration)
    return gained - run.medium.mass * (walls.sum(axis=0) + gravity)
