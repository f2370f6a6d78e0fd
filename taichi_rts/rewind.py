"""Setting a simulation back to its start, so that it can be timed again without being compiled again."""

import copy
from typing import Any

import numpy as np
import taichi as ti

PACKAGE = "taichi_rts"
PLAIN = (bool, int, float, str, type(None), np.ndarray, np.generic)


@ti.data_oriented
class Rewind:
    """Keeps a copy of all fields and plain numbers that a `Simulation` is made of; `restore` puts them back.

    A run from there gives the same bits again (where a device's own sums are deterministic). It costs the memory of the fields
    once more and two kernels, instead of compiling some thirty of them for each repeat.
    """

    def __init__(self, sim: Any) -> None:
        self.fields: list[Any] = []
        self.owners: list[tuple[dict[str, Any], dict[str, Any], frozenset[str]]] = []
        self._collect(sim, set())
        self.copies = [_like(each) for each in self.fields]
        self.save()

    def restore(self) -> None:
        """Set the simulation back to what it was when this object was made."""
        self.load()
        for owner, values, names in self.owners:
            for late in [name for name in owner if name not in names]:
                del owner[late]  # hides what the class says, such as `Schedule.needs_sorting`
            owner.update(copy.deepcopy(values))

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

    def _collect(self, thing: Any, seen: set[int]) -> None:
        if id(thing) in seen:
            return
        seen.add(id(thing))
        if isinstance(thing, ti.Field):
            self.fields.append(thing)
        elif isinstance(thing, (list, tuple)):
            for each in thing:
                self._collect(each, seen)
        elif isinstance(thing, dict):
            for each in thing.values():
                self._collect(each, seen)
        elif type(thing).__module__.split(".")[0] == PACKAGE and hasattr(thing, "__dict__"):
            values = {key: copy.deepcopy(value) for key, value in vars(thing).items() if _is_plain(value)}
            self.owners.append((vars(thing), values, frozenset(vars(thing))))
            for value in vars(thing).values():
                self._collect(value, seen)


def _is_plain(value: Any) -> bool:
    if isinstance(value, (list, tuple)):
        return all(_is_plain(each) for each in value)
    if isinstance(value, dict):
        return all(_is_plain(each) for each in value.values())
    return isinstance(value, PLAIN)


def _like(field: Any) -> Any:
    """Return a new field of the same type and shape."""
    if isinstance(field, ti.MatrixField):
        if field.m == 1:
            return ti.Vector.field(field.n, field.dtype, field.shape)
        return ti.Matrix.field(field.n, field.m, field.dtype, field.shape)
    return ti.field(field.dtype, field.shape)
