"""One step for all: the baseline."""

import math
from typing import Any, ClassVar, Literal

from pydantic.dataclasses import dataclass

from taichi_rts.device.backend import ti
from taichi_rts.device.fields import Declared, integers
from taichi_rts.errors import StepperError
from taichi_rts.scene.scene import Scene
from taichi_rts.scene.validation import FROZEN, Positive, validated
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.integrators.serna import Serna
from taichi_rts.solver.integrators.symplectic_euler import SymplecticEuler
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping import criteria
from taichi_rts.solver.stepping.base import ONE_STEP_COURANT, Courant, Schedule, Setup, Stepper
from taichi_rts.solver.stepping.timeline import Timeline

INTEGRATORS = {kind.name: kind for kind in (Serna, SymplecticEuler)}
SUBDIVISIONS = 64  # an adaptive step is a whole number of 64ths of the largest


@validated(StepperError)
@dataclass(frozen=True, config=FROZEN)
class Uniform(Stepper):
    """All particles share one step.

    Attributes:
        courant: lambda = dt c_s / r.
        integrator: "serna" (predictor-corrector, second order) or "symplectic_euler".
        adaptive: shorten each step to what c + |v| and the largest acceleration allow, over all particles; c is the sound speed
            of water as compressed as it is there.
        lambda_f: factor of the force limit (Eq. 2), used if adaptive.
    """

    courant: Courant = ONE_STEP_COURANT
    integrator: Literal["serna", "symplectic_euler"] = "serna"
    adaptive: bool = False
    lambda_f: Positive = 0.25

    name: ClassVar[str] = "uniform"
    key: ClassVar[str] = "u"
    compared: ClassVar[tuple[Setup, ...]] = (
        Setup("uniform"),
        Setup("uniform-c", {"adaptive": True}, regional_sound=True),
    )
    mapped: ClassVar[tuple[Setup, ...]] = (
        Setup("uniform", former=("serna",)),
        Setup("uniform-euler", {"integrator": "symplectic_euler"}, former=("euler",)),
        Setup("uniform-adaptive", {"adaptive": True}, former=("adaptive",)),
        Setup("uniform-c", {"adaptive": True}, regional_sound=True, former=("adaptive_c",)),
    )

    @property
    def follows_sound(self) -> bool:
        """Only the largest sound speed counts, and only if steps adapt to it."""
        return self.adaptive

    def make_integrator(self) -> Any:
        """Return the integrator's object."""
        return INTEGRATORS[self.integrator]()

    def equal_step(self, scene: Scene) -> float:
        """Its own."""
        return self.courant

    def timeline(self, scene: Scene) -> Timeline:
        """Return a clock that ticks once a step, or 64 times the largest step if adaptive."""
        step = min(
            criteria.acoustic_step(self.courant, scene.support, scene.wave_speed),
            criteria.scene_viscous_step(scene),
        )
        return Timeline(step / SUBDIVISIONS if self.adaptive else step)

    def schedule_fields(self, scene: Scene, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields of its schedule."""
        return UniformSchedule.fields(self, particles, blocks, serial=serial)

    def schedule(self, scene: Scene, particles: FluidState, grid: BlockGrid, timeline: Timeline) -> Schedule:
        """Build the schedule under which all particles are always due."""
        if self.adaptive:
            return AdaptiveSchedule(self, scene, particles, grid, timeline)
        return UniformSchedule(particles, grid)


@ti.data_oriented
class UniformSchedule(Schedule):
    """All particles, every step."""

    def __init__(self, particles: FluidState, grid: BlockGrid) -> None:
        super().__init__(particles, grid)
        particles.level.fill(1)
        self.due_count = particles.alive
        self.mark_all()

    @classmethod
    def fields(cls, settled: Any, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields for so many particles and blocks."""
        return super().fields(settled, particles, blocks, serial=serial) + integers(particles, "due")

    @ti.kernel
    def mark_all(self):
        for k in self.due:
            self.due[k] = k

    @ti.func
    def due_in(self, m):
        """All of the block."""
        block = self.grid.occupied[m]
        return self.grid.first(block), self.grid.first(block + 1)


@ti.data_oriented
class AdaptiveSchedule(UniformSchedule):
    """All particles, every step; the step follows the largest speed and acceleration. Costs one small read a step."""

    def __init__(
        self, stepper: Uniform, scene: Scene, particles: FluidState, grid: BlockGrid, timeline: Timeline
    ) -> None:
        super().__init__(particles, grid)
        self.scene = scene
        self.retime(stepper, timeline)
        self.base_ticks = round(SUBDIVISIONS * scene.wave_speed / scene.least_wave_speed)
        self.least_sound_speed = scene.least_wave_speed
        self.rest_density = scene.rest_density
        self.wall_signal = scene.wave_speed + scene.wall_speed if scene.wall_speed else 0.0
        self.signal = ti.field(float, ())
        self.acceleration2 = ti.field(float, ())

    def retime(self, stepper: Uniform, timeline: Timeline) -> bool:
        """Take another courant."""
        self.stepper = stepper
        self.tick = timeline.tick
        return True

    @ti.kernel
    def reduce_maxima(self):
        self.signal[None] = self.least_sound_speed
        self.acceleration2[None] = 0.0
        for i in range(self.particles.alive[None]):
            sound, reference = self.scene.wave_speed, self.rest_density
            if ti.static(self.particles.has_sound):
                sound, reference = self.particles.sound[i], self.particles.reference[i]
            stiffening = criteria.stiffening(self.particles.rho[i] / reference)
            ti.atomic_max(self.signal[None], criteria.signal_speed(sound, stiffening, self.particles.v[i].norm()))
            ti.atomic_max(self.acceleration2[None], self.particles.a[i].norm_sqr())

    def observe(self, now: int, tick: float) -> None:
        """Reduce the maxima that the next step depends on."""
        self.reduce_maxima()

    def next_ticks(self) -> int:
        """Ticks of the next step: the smallest of Eq. 1 with c + |v|, Eq. 2 and the fixed step."""
        signal, acceleration = self.signal[None], math.sqrt(self.acceleration2[None])
        support = self.scene.support
        step = min(
            criteria.acoustic_step(self.stepper.courant, support, max(signal, self.wall_signal)),
            criteria.force_step(self.stepper.lambda_f, support, acceleration),
        )
        return max(1, min(self.base_ticks, math.floor(step / self.tick))) if math.isfinite(step) else 1
