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
    """Where pictures are taken from: `azimuth` and `elevation` [degrees] around the domain, or `eye` and `target` [m], (3,).

    `zoom` enlarges what is seen from there. Raises `SceneError`.
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
