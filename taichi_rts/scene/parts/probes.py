"""Where a run is measured: probes of the pressure and gauges of the water's height."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import StringConstraints
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.validation import FROZEN, Vector, validated

Name = Annotated[str, StringConstraints(pattern=r"^[\w.+-]+$")]
"""Part of a column's name: letters, digits and _ . + - only."""


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Probe:
    """A point where pressure is measured.

    Attributes:
        position: [m], (dim,).
        name: heads its column of the time series; None: its number from 1.
    """

    position: Vector
    name: Name | None = None
    places = ("position",)


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Gauge:
    """A line along gravity's main axis on which the water's height is measured.

    Attributes:
        position: any point of it [m], (dim,).
        name: heads its column of the time series; None: its number from 1.
    """

    position: Vector
    name: Name | None = None
    places = ("position",)


def names(places: Sequence[Probe | Gauge]) -> list[str]:
    """Return the names of probes or gauges, with the defaults filled in."""
    return [place.name or str(number) for number, place in enumerate(places, start=1)]
