"""Asynchronous time stepping (Pregent, *Asynchronous SPH*): every cell keeps its own time.

A cell is a block of the grid. Its time T is that of its youngest particle, i.e. the earliest end of a step. It steps when no
neighbouring cell is younger: then every neighbour is in the middle of a step that spans T and can be interpolated to T.
Forces are evaluated at T; they correct the steps that end there and begin the next, as long as the cell's own limits allow.

Why this never extrapolates. A reader at time T in cell C reads particle j of C or of a cell beside it. (1) j's step ends
at T or later, because no cell beside C is younger than T. (2) j's last evaluation may lie after T, where C was woken or j
came from a cell further away; then j's evaluation before it lies at or before T, because a cell only steps if its
last evaluation lies at or before the youngest time T_min of all cells, T_min <= T, and T_min never goes back. The
same two states give every particle at any output time in reach without stepping it.
"""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.device.fields import Declared
from taichi_rts.errors import StepperError
from taichi_rts.scene.scene import Scene
from taichi_rts.scene.validation import FROZEN, Positive, validated
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.integrators.serna import Serna
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping import criteria
from taichi_rts.solver.stepping.base import ONE_STEP_COURANT, Courant, Schedule, Setup, Stepper
from taichi_rts.solver.stepping.passes import AsynchronousSchedule
from taichi_rts.solver.stepping.settled import SettledCells
from taichi_rts.solver.stepping.timeline import Timeline

DRIFT = 0.05
"""How far a particle may move over the support radius between two sorts: a little more than the longest step at Mach 0.1."""


@validated(StepperError)
@dataclass(frozen=True, config=FROZEN)
class Asynchronous(Stepper):
    """Every cell (a block of the grid) has its own time and its own step.

    Attributes:
        courant: the longest step is courant r/c_s; a cell faster than Mach 0.1 takes 1.1 courant r/(c_s + |v|), and one that is
            compressed by more than 3 % one shorter by as much as its sound is faster. None: 0.4.
        levels: base steps (ticks) in the longest step, more if the most viscous fluid needs shorter ones; 1 forces all equal.
        steps: lengths that steps may have, in ticks: "powers_of_two" keeps cells in step with each other, so that many can
            step at once; "integers" rounds the limits down to whole ticks only.
        lambda_f: factor of the force limit, Eq. 2 of Goswami & Batty 2014.
        limiter: bound a cell's step by its neighbours', wake neighbours, and let steps grow by one level at a time.
        inactive_density: what a stepping cell reads of others: carried through their steps with d rho/dt ("extrapolated", to
            the end of the step at most), as positions and velocities are, or "stale" (of the last evaluation), which makes
            the method first order.
        stagger: None, or the seed of random first steps, after which all cells have different ages.
    """

    courant: Courant | None = None
    levels: Annotated[int, Field(ge=1, le=1024)] = 8
    steps: Literal["powers_of_two", "integers"] = "powers_of_two"
    lambda_f: Positive = 0.05
    limiter: bool = True
    inactive_density: Literal["extrapolated", "stale"] = "extrapolated"
    stagger: Annotated[int, Field(ge=0, lt=2**31)] | None = None

    name: ClassVar[str] = "asynchronous"
    key: ClassVar[str] = "a"
    compared: ClassVar[tuple[Setup, ...]] = (Setup("asynchronous"), Setup("asynchronous-c", regional_sound=True))
    mapped: ClassVar[tuple[Setup, ...]] = (
        Setup("asynchronous"),
        Setup("asynchronous-integers", {"steps": "integers"}, former=("asynchronous_integers",)),
        Setup("asynchronous-c", regional_sound=True, former=("asynchronous_c",)),
    )

    @property
    def longest_courant(self) -> float:
        """Courant number of the longest step: as given, or that of `Uniform`."""
        return ONE_STEP_COURANT if self.courant is None else self.courant

    @model_validator(mode="after")
    def _check(self) -> "Asynchronous":
        if self.steps == "powers_of_two" and self.levels & (self.levels - 1):
            below = 1 << (self.levels.bit_length() - 1)
            raise ValueError(
                f"levels {self.levels} is no power of two; use {below} or {2 * below}, or steps='integers'"
            )
        return self

    @property
    def extrapolates_density(self) -> bool:
        """Whether d rho/dt is needed."""
        return self.inactive_density == "extrapolated" and self.levels > 1

    @property
    def keeps_past(self) -> bool:
        """Whether cells may have different times."""
        return self.levels > 1

    @property
    def drift(self) -> float:
        """With all steps equal every sort serves for one step only."""
        return DRIFT if self.levels > 1 else 0.0

    @property
    def follows_sound(self) -> bool:
        """With all steps equal there is nothing to follow."""
        return self.levels > 1

    @property
    def own_courant(self) -> float:
        """As given, or the default."""
        return self.longest_courant

    def equal_step(self, scene: Scene) -> float:
        """That of the longest step."""
        return self._step_courant(scene, self.timeline(scene).tick * self.levels)

    def make_integrator(self) -> Any:
        """Return the integrator's object: second order for any sequence of steps, corrected with the time that elapsed."""
        return Serna()

    def longest_step(self, scene: Scene) -> float:
        """The longest step [s] that any cell may take: with all equal the one that all may take."""
        slowest = scene.wave_speed if self.levels == 1 else scene.least_wave_speed
        acoustic = criteria.acoustic_step(self.longest_courant, scene.support, slowest)
        return min(acoustic, criteria.scene_viscous_step(scene, most=self.levels == 1))

    def ticks(self, scene: Scene) -> int:
        """Ticks in the longest step: `levels`, doubled until one tick is within the limits of every fluid and sound speed."""
        ticks, longest = self.levels, self.longest_step(scene)
        acoustic = criteria.acoustic_step(self.longest_courant, scene.support, scene.wave_speed)
        shortest = min(criteria.scene_viscous_step(scene), acoustic * (1.0 + 1e-9))
        while self.levels > 1 and longest / ticks > shortest:
            ticks *= 2
        return ticks

    def timeline(self, scene: Scene) -> Timeline:
        """Return a clock that ticks `ticks` times in the longest step."""
        return Timeline(self.longest_step(scene) / self.ticks(scene))

    def in_scene(self, scene: Scene) -> SettledCells:
        """Return the parameters of steps in `scene`."""
        return SettledCells(
            levels=self.ticks(scene),
            longest_courant=self.longest_courant,
            lambda_f=self.lambda_f,
            limiter=self.limiter,
            powers_of_two=self.steps == "powers_of_two",
            staggered=self.stagger is not None,
            seed=self.stagger or 0,
        )

    def schedule_fields(self, scene: Scene, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields of its schedule."""
        return AsynchronousSchedule.fields(self.in_scene(scene), particles, blocks, serial=serial)

    def schedule(self, scene: Scene, particles: FluidState, grid: BlockGrid, timeline: Timeline) -> Schedule:
        """Build the fields and kernels that find the cells that may step."""
        return AsynchronousSchedule(self.in_scene(scene), scene, particles, grid, timeline)
