"""What a simulation is made of, as far as those need it that read it, carry it on or draw up its budget."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from taichi_rts.device.backend import Backend
from taichi_rts.medium.medium import Medium
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.motion.inflow import Inflows
from taichi_rts.solver.motion.motion import Motion
from taichi_rts.solver.motion.outlet import Outlets
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.sound.rule import SoundRule
from taichi_rts.solver.stepping.base import Schedule, Stepper
from taichi_rts.solver.stepping.timeline import Timeline


class Run(Protocol):
    """The parts of a `Simulation`; what takes a `Run` need not know the class that wires them."""

    scene: Scene
    local: Scene
    stepper: Stepper
    backend: Backend
    medium: Medium
    timeline: Timeline
    particles: FluidState
    start_viscosities: np.ndarray
    grid: BlockGrid
    motion: Motion
    schedule: Schedule
    sound: SoundRule | None
    inflows: Inflows | None
    outlets: Outlets | None

    @property
    def time(self) -> float:
        """Physical time [s]."""
