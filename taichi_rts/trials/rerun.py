"""One simulation, compiled once, run again and again at other courants."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from taichi_rts.assembly.rewind import Rewind
from taichi_rts.scene.scene import Scene
from taichi_rts.simulation import Simulation
from taichi_rts.solver.stepping.base import Stepper


class Rerun:
    """Builds the `Simulation` of a scene and a stepper; for the next courant it is set back instead of compiled again.

    All steppers that it is given are to differ in nothing but their courant. `fresh` starts Taichi anew; it is called before
    a simulation is built, which ends the one before. Runs are the same to the last bit as those of new simulations.
    """

    def __init__(self, fresh: Callable[[], Any]) -> None:
        self.fresh = fresh
        self.sim: Simulation | None = None
        self.start: Rewind | None = None
        self.builds = 0

    def __call__(self, scene: Scene, stepper: Stepper, *, debug: bool = False) -> Simulation:
        """Return a simulation of `scene` with `stepper` at its start."""
        sim = self.sim
        if sim is not None and self.start is not None:
            self.start.restore()
            sim.stepper, sim.solver.timeline = stepper, stepper.timeline(scene)
            if sim.scene is not scene or not sim.schedule.retime(stepper.in_scene(scene), sim.timeline):
                sim = None
        if sim is None:
            self.fresh()
            # It has evaluated nothing yet, so that it can still take another courant.
            self.sim = sim = Simulation(scene, stepper, debug=debug, started=False)
            self.start = Rewind(sim)
            self.builds += 1
        sim.start()
        return sim
