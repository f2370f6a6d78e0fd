"""Where a run's coordinates begin: single precision tells places near 0 apart, so the device counts from near its domain.

Each part of a scene names those of its fields that are coordinates in `places`.
"""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import numpy as np

from taichi_rts.scene.fluids.particles import Particles
from taichi_rts.scene.parts.velocities import Field
from taichi_rts.scene.scene import Scene
from taichi_rts.scene.validation import Vector


def origin_of(scene: Scene) -> Vector:
    """Return the point [m], (dim,), from which a run of `scene` counts its positions.

    Along each axis it is 0 where the domain begins or ends within its own longest side of 0, or on both sides of it; else the
    domain's lower face. So no coordinate of a run exceeds twice the domain's size; and taking the origin off is exact.
    """
    reach = max(scene.domain.size)
    faces = zip(scene.domain.lower, scene.domain.upper, strict=True)
    return tuple(0.0 if low <= reach and high >= -reach else low for low, high in faces)


def at_origin(scene: Scene) -> Scene:
    """Return `scene` with its coordinates counted from `origin_of` it; the same object where that is 0."""
    origin = origin_of(scene)
    return translated(scene, tuple(-x for x in origin)) if any(origin) else scene


def placed(scene: Scene, x: np.ndarray) -> np.ndarray:
    """Positions `x` [m], (..., dim), counted from `origin_of` it, as `scene` counts: in double precision unless that is 0."""
    origin = origin_of(scene)
    if not any(origin):
        return x
    return np.clip(x + np.asarray(origin), scene.domain.lower, scene.domain.upper)


def translated(thing: Any, shift: Vector) -> Any:
    """Return a scene, or a part of one, moved by `shift` [m], (dim,). It is not checked again: moving makes nothing wrong."""
    if isinstance(thing, tuple):
        return tuple(translated(each, shift) for each in thing)
    if isinstance(thing, Particles):
        return thing.translated(shift)
    if not dataclasses.is_dataclass(thing):
        return thing
    moved = copy.copy(thing)
    for field in dataclasses.fields(thing):
        value = getattr(thing, field.name)
        if field.name not in getattr(thing, "places", ()):
            value = translated(value, shift)
        elif value is not None or isinstance(thing, Field):  # the default of a field's origin is 0
            value = _moved(value or (0.0,) * len(shift), shift)
        object.__setattr__(moved, field.name, value)
    return moved


def _moved(place: Any, shift: Vector) -> Any:
    """Return a coordinate, or a tuple of them, moved; the third of a camera in a two-dimensional scene stays."""
    if isinstance(place[0], tuple):
        return tuple(_moved(each, shift) for each in place)
    return tuple(x + by for x, by in zip(place, (*shift, 0.0), strict=False))
