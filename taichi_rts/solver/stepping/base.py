"""What a stepper is: a frozen description that users write, and a schedule that says which particles are due."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import Field

from taichi_rts.device.backend import ti
from taichi_rts.device.fields import Declared, Part, integers
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.integrators.serna import Serna
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping.timeline import Timeline

if TYPE_CHECKING:
    from typing_extensions import Self

ONE_STEP_COURANT = 0.4
"""Courant number of steps that are the same for all, and of the longest asynchronous ones, at the defaults."""
Courant = Annotated[float, Field(gt=0, le=2)]


@dataclasses.dataclass(frozen=True)
class Setup:
    """A stepper with some `parameters` under a name of its own, as `taichi-rts compare` and `stability` run it.

    Attributes:
        name: on the command line and in tables.
        parameters: those that are not the stepper's defaults.
        courant: its default; None: `own_courant` with these parameters.
        regional_sound: whether it runs with the regional sound speed.
        of_longest: whether a comparison's courant is that of the longest step, else the parameter `courant` as it is.
        former: names that it had before, which the command line still takes.
    """

    name: str
    parameters: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    courant: float | None = None
    regional_sound: bool = False
    of_longest: bool = True
    former: tuple[str, ...] = ()


class Stepper:
    """A stepper's parameters, and how they become a schedule for one run. To add one, write one file like `uniform.py`.

    Derive a frozen dataclass from it, with a `name`, a field `courant`, and the methods `timeline` and `schedule`; what else is
    here has values that serve for steps in which all particles are due. docs/extending.md shows one.

    Attributes:
        name: on the command line, in files and in messages.
        key: letter that chooses it in the window, besides its number; empty for none.
        block_integers: how many fields of 32-bit integers its schedule has with an entry for each block of the grid, at most,
            unless `schedule_fields` says it exactly.
        compared: what `taichi-rts compare` calls by which names; empty: the stepper alone, by its own.
        mapped: what the stability map has columns for; empty: the stepper alone, by its own name.
    """

    name: ClassVar[str]
    key: ClassVar[str] = ""
    block_integers: ClassVar[int] = 9
    compared: ClassVar[tuple[Setup, ...]] = ()
    mapped: ClassVar[tuple[Setup, ...]] = ()

    @property
    def follows_sound(self) -> bool:
        """Whether steps follow the sound speed of each region, so that a regional one can pay."""
        return False

    @property
    def extrapolates_density(self) -> bool:
        """Whether the densities of particles that are not due follow d rho/dt, which then has to be computed."""
        return False

    @property
    def keeps_past(self) -> bool:
        """Whether particles may be read at times before their last evaluation, so that the state before it is needed."""
        return False

    @property
    def drift(self) -> float:
        """How far a particle may move, over the support radius, before the grid is sorted anew; 0: every step."""
        return 0.0

    @property
    def own_courant(self) -> float:
        """The parameter `courant`, where it is None its default."""
        return self.courant  # type: ignore[attr-defined, no-any-return]

    @property
    def longest_courant(self) -> float:
        """Courant number of the longest step in water at rest density."""
        return self.own_courant

    def with_longest(self, courant: float) -> Self:
        """Return a copy whose longest step is `courant` r/c_s."""
        return dataclasses.replace(self, courant=courant)  # type: ignore[type-var]

    def equal_step(self, scene: Scene) -> float:
        """Courant number of the uniform steps that it is compared with at equal step: that of its base step."""
        return self._step_courant(scene, self.timeline(scene).tick)

    @staticmethod
    def _step_courant(scene: Scene, step: float) -> float:
        """Courant number of a `step` [s]; rounded, so that equal steps are equal numbers."""
        return float(f"{step * scene.wave_speed / scene.support:.10g}")

    def make_integrator(self) -> Any:
        """Return the integrator, an object as in `taichi_rts.solver.integrators`."""
        return Serna()

    def in_scene(self, scene: Scene) -> Any:
        """Return what the schedule takes of the parameters: all that `scene` decides is decided (`settled.py`)."""
        return self

    def timeline(self, scene: Scene) -> Timeline:
        """Return the clock for `scene`: its tick divides the base step."""
        raise NotImplementedError

    def schedule_fields(self, scene: Scene, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields that its schedule makes in `scene`, for so many particles and blocks; `serial`: on a CPU.

        Memory is counted from them before a run. This is an estimate, with two fields of integers for each particle.
        """
        names = [f"integers {n}" for n in range(self.block_integers)]
        return [*integers(particles, "due", "flag"), *integers(blocks, *names)]

    def schedule(self, scene: Scene, particles: FluidState, grid: BlockGrid, timeline: Timeline) -> Schedule:
        """Build the fields and kernels that decide which particles are due."""
        raise NotImplementedError


@ti.data_oriented
class Schedule(Part):
    """Which particles are due in the present step.

    Attributes:
        due: places (in the grid's order) of the due particles, ascending; `due_count` of them. Those of a block are
            `due[due_start[block]]` and its `block_due[block]` - 1 successors.
        read_at: for each block the time at which due particles may read its particles, in ticks after `now`; negative
            where none does.
        base_ticks: ticks in one base step.
        levels: number of levels; level n steps every n base steps.
        aligned: whether steps end at multiples of themselves.
        levels_double: whether steps come in octaves rather than one by one, which is how pictures and tables group them.
        needs_sorting: whether the grid has to be sorted before the present step.
        sound: the rule of the regional sound speed (`SoundRule`), or None; `needs_sound` says whether it has to be worked out
            before the present step.
        steps: base steps begun so far.
        debug: check at run time what is true by construction.
    """

    levels = 1
    levels_double = False
    aligned = False
    base_ticks = 1
    needs_sorting = True
    needs_sound = True
    sound: Any = None
    transient = frozenset({"due", "flag"})

    def __init__(self, particles: FluidState, grid: BlockGrid, settled: Any = None) -> None:
        self.particles = particles
        self.grid = grid
        self.due = grid.rank  # which only a sort needs, and after a sort the list is made anew
        self.due_count = ti.field(ti.i32, ())
        self.make_fields(self.fields(settled, particles.capacity, grid.geometry.blocks, serial=grid.serial))
        self.steps = 0
        self.debug = False

    @classmethod
    def fields(cls, settled: Any, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields for so many particles and blocks: all that the constructor makes, those of derived classes too.

        `settled` is what the stepper has settled for the scene (`Stepper.in_scene`), or None; `serial`: on a CPU.
        """
        return integers(blocks, "read_at")

    @ti.func
    def due_in(self, m):
        """First entry of `due` that lies in the occupied block number `m`, and one past the last."""
        block = self.grid.occupied[m]
        return self.due_start[block], self.due_start[block] + self.block_due[block]

    def begin(self, timeline: Timeline, target: int) -> bool:
        """Set the clock to the next step and return True, unless that step ends after tick `target`.

        What the steps are depends on the state only, never on `target`.
        """
        ticks = self.next_ticks()
        if timeline.now + ticks > target:
            return False
        timeline.now += ticks
        self.steps += 1
        return True

    def restart(self, now: int) -> None:
        """Forget steps and levels: at tick `now` all particles are due, as at the start."""

    def next_ticks(self) -> int:
        """Length of the next step in ticks; it depends on the state only."""
        return 1

    def sorted(self, now: int, tick: float) -> None:
        """Take note that the grid has been sorted anew."""

    def select(self, now: int, tick: float) -> None:
        """Decide which particles are due at tick `now` (Algorithm 1, lines 5-16)."""

    @ti.func
    def evaluated(self, i, acceleration, tick):
        """Take note of the new `acceleration` [m/s^2] of the due particle `i`; `tick` [s]."""

    def observe(self, now: int, tick: float) -> None:
        """Look at the state after a step, to choose the next."""

    def retime(self, settled: Any, timeline: Timeline) -> bool:
        """Take another courant, before the first step: `settled` has it (`Stepper.in_scene`) and else equals the present one.

        Returns whether the compiled kernels serve for it.
        """
        return True

    def take_counts(self) -> tuple[list[int], list[int]]:
        """Return particles and updates per level, each summed over the steps since the last call, and forget them.

        Empty lists stand for "every particle, every step, level 1".
        """
        return [], []

    def statistics(self) -> dict[str, Any]:
        """Return what else this stepper has to say about the work so far."""
        return {}
