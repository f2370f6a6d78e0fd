"""What is simulated: a frozen, validated description, as plain as the TOML file that may hold it.

Its fields stand in `fields.py`, the lengths and speeds that follow from them in `scales.py`, what may be wrong in `checks/`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import pydantic
from pydantic import model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.checks.contradictions import contradictions
from taichi_rts.scene.fields import SceneFields
from taichi_rts.scene.scales import SceneScales
from taichi_rts.scene.validation import FROZEN, validated

WORTHWHILE = 2.0
"""Ratio of the one sound speed to the smallest regional one from which on regional ones pay (docs/regional_sound_speed.md)."""


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Scene(SceneScales):  # noqa: D101  documented once, with its fields
    __doc__ = SceneFields.__doc__

    @model_validator(mode="after")
    def _check(self) -> Scene:
        faults = contradictions(self)
        if faults:
            raise ValueError("\n  ".join(faults))
        return self

    def with_sound_for(self, stepper: Any) -> Scene:
        """Return the scene with "auto" decided for `stepper`, an object of `taichi_rts.solver.stepping.steppers`.

        Regional for steppers that can use it (`follows_sound`), where density is summed, without background pressure, and
        where sound speeds may differ by `WORTHWHILE`; else one sound speed.
        """
        if self.sound_speed != "auto":
            return self
        regional = self.replace(sound_speed="regional") if self.bears_regional_sound else self
        pays = stepper.follows_sound and self.wave_speed >= WORTHWHILE * regional.least_wave_speed
        return regional if pays and self.bears_regional_sound else self.replace(sound_speed=None)

    def replace(self, **changes: Any) -> Scene:
        """Return a copy with some fields changed; raises `SceneError` as the constructor does."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}  # type: ignore[arg-type]
        return Scene(**(fields | changes))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data that JSON and TOML can hold."""
        return pydantic.TypeAdapter(Scene).dump_python(self, mode="json", exclude_none=True)

    def __rich_repr__(self) -> Iterator[Any]:
        yield self.name
        yield "domain", self.domain
        yield "fluids", len(self.fluids)
        yield "particles", round(self.volume / self.spacing**self.dim)
        yield "spacing", self.spacing
        yield "end_time", self.end_time
