"""Resets a simulation to its start, so that it can be timed again without compiling."""

import copy
import math
from typing import Any

from taichi_rts.assembly.inventory import State
from taichi_rts.assembly.resources import MOST_ADDRESSED
from taichi_rts.device.backend import ti

WIDEST = 8  # bytes of one entry


@ti.data_oriented
class Rewind:
    """Keeps a copy of all fields and plain numbers of a `Simulation` (`State`); `restore` puts them back.

    A run from there gives the same bits again (where a device's own sums are deterministic). It costs the memory of the fields
    once more and two kernels, instead of compiling some thirty of them for each repeat.
    """

    def __init__(self, sim: Any) -> None:
        state = State(sim)
        self.sim = sim
        self.fields = list(state.fields.values())
        self.owners: list[tuple[dict[str, Any], dict[str, Any], frozenset[str]]] = []
        values: dict[str, dict[str, Any]] = {path: {} for path in state.owners}
        for path, name, value in state.values():
            values[path][name] = copy.deepcopy(value)
        for path, owner in state.owners.items():
            self.owners.append((owner, values[path], frozenset(owner)))
        self.copies = self._copies()
        self.save()

    def restore(self) -> None:
        """Set the simulation back to what it was when this object was made."""
        self.load()
        for owner, values, names in self.owners:
            for late in [name for name in owner if name not in names]:
                del owner[late]  # hides what the class says, such as `Schedule.needs_sorting`
            owner.update(copy.deepcopy(values))
        self.sim.restored()

    def _copies(self) -> list[Any]:
        """Return a field like each, in several buffers if one would be too large for the device's addresses."""
        copies, together = [], 0
        for field in self.fields:
            size = math.prod(field.shape) * getattr(field, "n", 1) * getattr(field, "m", 1) * WIDEST
            if together + size > MOST_ADDRESSED:
                ti.sync()  # ends the buffer
                together = 0
            copies.append(_like(field))
            together += size
        return copies

    @ti.kernel
    def save(self):
        for k in ti.static(range(len(self.fields))):
            for place in ti.grouped(self.fields[k]):
                self.copies[k][place] = self.fields[k][place]

    @ti.kernel
    def load(self):
        for k in ti.static(range(len(self.fields))):
            for place in ti.grouped(self.fields[k]):
                self.fields[k][place] = self.copies[k][place]


def _like(field: Any) -> Any:
    """Return a new field of the same type and shape."""
    if isinstance(field, ti.MatrixField):
        if field.m == 1:
            return ti.Vector.field(field.n, field.dtype, field.shape)
        return ti.Matrix.field(field.n, field.m, field.dtype, field.shape)
    return ti.field(field.dtype, field.shape)
