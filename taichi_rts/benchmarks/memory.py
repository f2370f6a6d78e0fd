"""Memory of a run, field by field."""

import math

import taichi_rts as rts
from taichi_rts.assembly.inventory import State
from taichi_rts.device.backend import ti

BYTES = {ti.f32: 4, ti.f64: 8, ti.i32: 4, ti.u32: 4}


def memory_of(sim: rts.Simulation) -> dict[str, int]:
    """Return the bytes of every field that can be reached from `sim`, the largest first."""
    sizes: dict[str, int] = {}
    counted: set[int] = set()
    for path, field in State(sim, everything=True).fields.items():
        # Without components that have been found under another path.
        parts = {id(part) for part in field._get_field_members()} - counted
        counted |= parts
        sizes[path] = len(parts) * BYTES[field.dtype] * math.prod(field.shape)
    return dict(sorted(sizes.items(), key=lambda item: -item[1]))
