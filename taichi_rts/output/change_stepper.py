"""Going on with another stepper: the present state of one simulation becomes that of another of the same scene."""

from __future__ import annotations

import math
from typing import Any

from taichi_rts.simulation import Simulation
from taichi_rts.solver.stepping.base import Stepper


def change_stepper(sim: Simulation, stepper: Stepper, **changes: Any) -> Simulation:
    """Return a simulation that goes on from the present state of `sim` with another `stepper`.

    `changes` replace fields of its scene that fluid and walls do not depend on, such as `kinematic_viscosity`. The time is
    moved on to the next tick of the new stepper's clock. Raises `StepperError` or `SceneError`.
    """
    other = Simulation(sim.scene.replace(**changes), stepper, forces=sim.forces, debug=sim.schedule.debug)
    hand_over(sim, other)
    return other


def hand_over(sim: Simulation, other: Simulation) -> None:
    """Let `other`, a simulation of the same scene, go on from the present state of `sim`, which is moved on to its next tick."""
    tick = other.timeline.tick
    sim.advance_to(max(sim.time, math.ceil(sim.time / tick * (1.0 - 1e-12)) * tick))
    other.continue_from(sim.snapshot())
