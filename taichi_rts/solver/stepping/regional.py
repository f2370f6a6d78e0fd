"""Regional time stepping (Goswami & Batty 2014): every block of side r steps at n base steps."""

import math
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from taichi_rts.device.fields import Declared
from taichi_rts.errors import StepperError
from taichi_rts.scene.scene import Scene
from taichi_rts.scene.validation import FROZEN, Positive, validated
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.integrators.serna import Serna
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping import criteria
from taichi_rts.solver.stepping.aligned import AlignedBlocks
from taichi_rts.solver.stepping.base import ONE_STEP_COURANT, Courant, Schedule, Setup, Stepper
from taichi_rts.solver.stepping.by_sound import BlocksBySound
from taichi_rts.solver.stepping.regions import RegionalSchedule
from taichi_rts.solver.stepping.settled import SettledRegions, lengths
from taichi_rts.solver.stepping.timeline import Timeline
from taichi_rts.solver.stepping.validity import ValidityByParticle

LARGEST_COURANT = 0.6
"""Courant number of the longest step at the defaults. Still pools are as calm as at 0.4, and errors in dam breaks no larger; at
0.7 pools move twice as much, at 0.8 they simmer (`docs/evidence/defaults.md`)."""

MOST_LEVELS = 32
PRESETS: dict[str | None, dict[str, Any]] = {
    None: {"levels": 3, "strict_cfl": False, "lambda_f": 0.1},
    "paper": {
        "courant": 0.4,
        "levels": 3,
        "strict_cfl": False,
        "lambda_f": 0.1,
        "limiter": False,
        "steps": "integers",
        "beta_decay": 0.2,
    },
}
"""The paper asks for lambda_f <= 0.25. At 0.25 a double dam break gains 2.2 % of energy, at 0.1 0.1 %
(docs/evidence/defaults.md)."""
REGIONAL_SOUND: dict[str, Any] = {
    "courant": 0.4,
    "strict_cfl": False,
    "lambda_f": 0.1,
    "limiter": True,
    "steps": "half_octaves",
    "beta_decay": 1.0,
}
"""What fields that are None become in a scene with a regional sound speed; `levels` follows from the range of sound speeds.

At a courant of 0.6 pools are as calm, but one of 1 m stands 1.1 % too low after 2 s, at 0.4 0.8 %.
"""
FROM_LEVELS: dict[str, Any] = {
    "courant": lambda levels: LARGEST_COURANT / levels if levels > 1 else ONE_STEP_COURANT,
    "limiter": lambda levels: (
        levels > 2
    ),  # with two levels it changes nothing but the work (docs/evidence/asynchronous.md)
    "steps": lambda levels: "half_octaves" if levels in lengths("half_octaves", levels) else "integers",
}


PAPERS: dict[str, Any] = {key: PRESETS["paper"][key] for key in ("steps", "beta_decay")}
"""The paper's levels, within Eq. 1 by a smaller courant."""


@validated(StepperError)
@dataclass(frozen=True, config=FROZEN)
class Regional(Stepper):
    """Blocks get steps of n base steps; only due particles recompute density and forces.

    Attributes:
        courant: lambda_v of Eq. 1; with `strict_cfl` off it sets the base step, with it on the longest step. None: 0.6 / levels,
            so that the longest step is 0.6 r/c_s; with one level as `Uniform`.
        levels: n_max, the largest n; None: 3.
        corrector: apply Serna's correction (Eq. 6-7); without it the method blows up (the paper's Figure 2).
        strict_cfl: divide the base step by n_max, so that the longest step too respects Eq. 1.
        preset: "paper" for the paper's setting (courant 0.4, 3 levels, Eq. 1 not enforced for n >= 2); explicit arguments
            win.
        alpha, beta, beta_decay: Eq. 3, with beta_n = beta * beta_decay^(n-2). None: no decay (1) where the longest step is at
            most 0.6 r/c_s, so that Eq. 1 holds; else the paper's 0.2.
        lambda_f: Eq. 2, at most 0.25 in the paper; None: 0.1.
        local_sound: shorten steps to what Eq. 1 allows the sound of water that is compressed by more than 3 % (Tait stiffens
            it: 2.7 c_s at 1.4 rho_0); the base step stays. It moved no limit in the stability map, and disturbs the first
            steps of pools whose corners start compressed (docs/evidence/stability.md).
        grading: let the levels of neighbouring blocks differ by at most one (R_min alone leaves jumps from 1 to 3).
        limiter: the neighbour limiter: no block's step exceeds twice a neighbour's, and steps grow by one level at a time, when
            synchronised. (Waking needs none: line 12 re-evaluates particles whose block has another step.) None: on
            from three levels up, off in the paper's preset.
        inactive_density: what due particles read of others: "stale" (of the last evaluation) or "extrapolated".
        steps: levels that blocks may have: "integers", "half_octaves" (1, 2, 3, 4, 6, 8, 12, ...) or "powers_of_two"; None: half
            octaves, but integers in the paper's preset and where n_max is no half octave. Except for integers with one sound
            speed, steps end at multiples of themselves, so that blocks of one level are due together, and base steps in which
            no particle is due are passed over.

    In a scene with a regional sound speed the base step is lambda_v r over the largest sound speed, level n means that Eq. 1
    holds for n base steps with the block's own, and Eq. 3 is left to the sound speed, which follows the velocity.
    """

    courant: Courant | None = None
    levels: Annotated[int, Field(ge=1, le=MOST_LEVELS)] | None = None
    corrector: bool = True
    strict_cfl: bool | None = None
    preset: Literal["paper"] | None = None
    alpha: Positive = 0.4
    beta: Positive = 0.4
    beta_decay: Annotated[float, Field(gt=0, le=1)] | None = None
    lambda_f: Positive | None = None
    local_sound: bool = False
    grading: bool = False
    limiter: bool | None = None
    inactive_density: Literal["stale", "extrapolated"] = "stale"
    steps: Literal["integers", "half_octaves", "powers_of_two"] | None = None

    name: ClassVar[str] = "regional"
    key: ClassVar[str] = "g"
    compared: ClassVar[tuple[Setup, ...]] = (
        Setup("regional"),
        Setup("paper", {"preset": "paper"}, of_longest=False),
        Setup("regional-c", regional_sound=True),
    )
    mapped: ClassVar[tuple[Setup, ...]] = (
        Setup("regional"),
        Setup("regional-2", {"levels": 2, **PAPERS}, 0.2, former=("regional_2",)),
        Setup("regional-3", {"levels": 3, **PAPERS}, 0.4 / 3, former=("regional_3",)),
        Setup("paper", {"preset": "paper"}, former=("regional_paper",)),
        Setup("regional-c", courant=REGIONAL_SOUND["courant"], regional_sound=True, former=("regional_c",)),
    )

    def resolved(self, key: str) -> Any:
        """Return parameter `key`: as given, else from the preset."""
        value = getattr(self, key)
        if value is None:
            value = PRESETS[self.preset].get(key)
        if value is None and key == "beta_decay":
            return 1.0 if self.longest_courant <= LARGEST_COURANT * (1.0 + 1e-9) else 0.2
        return FROM_LEVELS[key](self.resolved("levels")) if value is None else value

    def in_scene(self, scene: Scene) -> SettledRegions:
        """Return the parameters of steps in `scene`; raises `StepperError` if the preset is not for such a scene."""
        full = self._filled(scene)
        levels = full.resolved("levels")
        decay = full.resolved("beta_decay")
        return SettledRegions(
            levels=levels,
            longest_courant=full.longest_courant,
            lambda_f=full.resolved("lambda_f"),
            limiter=full.resolved("limiter"),
            courant=full.resolved("courant"),
            strict_cfl=full.resolved("strict_cfl"),
            aligned=scene.regional_sound is not None or full.resolved("steps") != "integers",
            lengths=tuple(lengths(full.resolved("steps"), levels)),
            fractions=tuple(criteria.velocity_fraction(n, self.alpha, self.beta, decay) for n in range(2, levels + 1)),
            local_sound=self.local_sound,
            grading=self.grading,
        )

    def _filled(self, scene: Scene) -> "Regional":
        """Return a copy in which nothing is None any more."""
        if scene.regional_sound is None:
            keys = ("levels", "courant", "strict_cfl", "lambda_f", "limiter", "steps", "beta_decay")
            settings: dict[str, Any] = {key: self.resolved(key) for key in keys}
            return replace(self, **settings)
        if self.preset is not None:
            raise StepperError(
                f"preset {self.preset!r} is for one sound speed; leave it out, or give the scene a sound_speed [m/s]"
            )
        ratio = scene.wave_speed / scene.least_wave_speed
        levels = min(MOST_LEVELS, math.floor(ratio * (1.0 + 1e-9)))
        if (self.steps or REGIONAL_SOUND["steps"]) == "powers_of_two":
            levels = 1 << (levels.bit_length() - 1)
        defaults: dict[str, Any] = REGIONAL_SOUND | {"levels": levels}
        settings = {key: value for key, value in defaults.items() if getattr(self, key) is None}
        return replace(self, **settings)

    @property
    def extrapolates_density(self) -> bool:
        """Whether d rho/dt is needed."""
        return self.inactive_density == "extrapolated" and self.resolved("levels") > 1

    @property
    def follows_sound(self) -> bool:
        """The paper's setting has one sound speed."""
        return self.preset is None

    def make_integrator(self) -> Any:
        """Return the integrator's object."""
        return Serna(self.corrector)

    @property
    def own_courant(self) -> float:
        """As given, or the default."""
        return self.resolved("courant")

    @property
    def longest_courant(self) -> float:
        """Courant number of the longest step in water at rest density."""
        return self.resolved("courant") * (1 if self.resolved("strict_cfl") else self.resolved("levels"))

    def with_longest(self, courant: float) -> "Regional":
        """Return a copy whose longest step, of all levels, is `courant` r/c_s."""
        return replace(self, courant=courant / (1 if self.resolved("strict_cfl") else self.resolved("levels")))

    def timeline(self, scene: Scene) -> Timeline:
        """Return a clock that ticks once a base step: lambda_v r/c_s, divided by n_max if strict."""
        settled = self.in_scene(scene)
        step = criteria.acoustic_step(settled.courant, scene.support, scene.wave_speed)
        divisor = settled.levels if settled.strict_cfl else 1
        return Timeline(min(step / divisor, criteria.scene_viscous_step(scene)))

    def schedule(self, scene: Scene, particles: FluidState, grid: BlockGrid, timeline: Timeline) -> Schedule:
        """Build the schedule of Algorithm 1: by particle as in the paper, of aligned blocks, or by sound speed."""
        return self._scheme(scene)(self.in_scene(scene), scene, particles, grid)

    def schedule_fields(self, scene: Scene, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields of its schedule."""
        return self._scheme(scene).fields(self.in_scene(scene), particles, blocks, serial=serial)

    def _scheme(self, scene: Scene) -> type[RegionalSchedule]:
        if scene.regional_sound is not None:
            return BlocksBySound
        return AlignedBlocks if self.in_scene(scene).aligned else ValidityByParticle
