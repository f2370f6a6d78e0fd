"""How stiff the fluid is, region by region: the description. The rule itself is `physics.sound_rule`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Tag, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.validation import FROZEN, Positive, validated

FLOOR = 6.8
"""Floor of the regional sound speed over sqrt(g H): water at rest would be compressed by 1/6.8^2 = 2.2 % at the bottom."""


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class RegionalSound:
    """Every block of the grid has the sound speed that the flow in it and beside it needs.

    Attributes:
        mach: largest local Mach number, and root of the largest compression: the sound speed is 1/mach times the largest speed
            nearby, and 1/mach times sqrt(p/rho_0).
        floor: smallest sound speed [m/s]; None: 6.8 sqrt(g H), H being the largest depth of the scene's fluids, one on top of
            the other.
        cap: largest sound speed [m/s], which sets the base step; None: twenty times an estimate of the largest speed.
        memory: over how many crossing times r/c of a block the sound speed falls once it may, and the reference density
            relaxes.
    """

    mach: Positive = 0.1
    floor: Positive | None = None
    cap: Positive | None = None
    memory: Positive = 40.0

    @model_validator(mode="after")
    def _check(self) -> RegionalSound:
        if self.floor is not None and self.cap is not None and self.floor > self.cap:
            raise ValueError(f"floor {self.floor:g} exceeds cap {self.cap:g}; lower it, or raise the cap")
        return self


def _kind(data: Any) -> str:
    """Name the kind of sound speed that `data` looks like, so that a mistake is not reported for the others as well."""
    if isinstance(data, dict | RegionalSound):
        return "<RegionalSound>"
    try:
        float(data)
    except (TypeError, ValueError):
        return "<word>"
    return "<number>"


SoundSpeed = Annotated[
    Annotated[Positive, Tag("<number>")]
    | Annotated[Literal["regional", "auto"], Tag("<word>")]
    | Annotated[RegionalSound, Tag("<RegionalSound>")],
    Discriminator(_kind),
]
"""One sound speed [m/s] for all, or what governs a regional one."""
