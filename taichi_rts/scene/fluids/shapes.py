"""All shapes of fluid: a new one is a file beside this one and a place in `FLUID_SHAPES`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from taichi_rts.scene.fluids.block import Block
from taichi_rts.scene.fluids.particles import Particles
from taichi_rts.scene.fluids.shape import FluidShape
from taichi_rts.scene.fluids.sphere import Sphere
from taichi_rts.scene.schema import one_of

FLUID_SHAPES: tuple[type[FluidShape], ...] = (Block, Sphere, Particles)


def _kind(data: Any) -> type:
    if isinstance(data, FLUID_SHAPES):
        return type(data)
    keys = data.keys() if isinstance(data, dict) else set()
    return next((kind for kind in reversed(FLUID_SHAPES) if kind.telling & keys), FLUID_SHAPES[0])


if TYPE_CHECKING:
    Fluid = FluidShape
else:
    Fluid = one_of(FLUID_SHAPES, _kind)
"""Fluid of any shape; in a scene file it is known by its keys (`FluidShape.telling`)."""


def separation(one: FluidShape, two: FluidShape) -> float:
    """Distance [m] of the two, negative if they overlap; of two blocks only the sign counts."""
    earlier, later = sorted((one, two), key=lambda fluid: FLUID_SHAPES.index(type(fluid)))
    return later.separation(earlier)
