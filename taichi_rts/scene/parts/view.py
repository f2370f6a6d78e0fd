"""Where pictures are taken from."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.validation import FROZEN, Number, Positive, Vector, validated


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class View:
    """Where pictures are taken from: angles around the domain, or `eye` and `target`. Raises `SceneError`.

    Attributes:
        azimuth: [degrees] around the vertical, which is against gravity; at 0 the x axis runs to the right (y or z if x is up).
        elevation: [degrees] above the ground.
        eye, target: where the camera is and what it looks at [m], (3,), instead of the angles; None: by the angles.
        zoom: how much larger than the whole domain would be.
    """

    azimuth: Number = -35.0
    elevation: Annotated[Number, Field(ge=-90, le=90)] = 20.0
    eye: Vector | None = None
    target: Vector | None = None
    zoom: Positive = 1.0
    places = ("eye", "target")

    @model_validator(mode="after")
    def _check(self) -> View:
        given = [place for place in (self.eye, self.target) if place is not None]
        if len(given) == 1:
            raise ValueError("eye and target go together; give both, or azimuth and elevation instead")
        if given and (len(given[0]) != 3 or len(given[1]) != 3 or given[0] == given[1]):
            raise ValueError(
                f"eye {self.eye} and target {self.target} must be two places of 3 components each; move one"
            )
        return self
