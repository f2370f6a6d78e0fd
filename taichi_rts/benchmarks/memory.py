"""Memory of a run, field by field."""

import math

import taichi as ti

import taichi_rts as rts
from taichi_rts.state import State

BYTES = {ti.f32: 4, ti.f64: 8, ti.i32: 4}


def memory_of(sim: rts.Simulation) -> dict[str, int]:
    """Return the bytes of every field that can be reached from `sim`, the largest first."""
    sizes = {}
    for path, field in State(sim, everything=True).fields.items():
        parts = field.n * field.m if isinstance(field, ti.MatrixField) else 1
        sizes[path] = parts * BYTES[field.dtype] * math.prod(field.shape)
    return dict(sorted(sizes.items(), key=lambda item: -item[1]))
