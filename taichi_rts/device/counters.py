"""Counts that do not overflow, also where a device only has 32-bit integers."""

from typing import Any

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.device.fields import Declared, Part


@ti.data_oriented
class Counters(Part):
    """Counts of up to 2^64 - 1, each in two fields of 32 bits: its lower half, and how often that has run over.

    With `alone` no two threads ever add to the same entry, so that additions need not be atomic.
    """

    def __init__(self, count: int = 1, *, alone: bool = False) -> None:
        self.alone = alone
        self.make_fields(self.fields(count))

    @staticmethod
    def fields(count: int = 1) -> list[Declared]:
        """Declare the fields of `count` counts."""
        return [Declared(name, ti.u32, count) for name in ("low", "high")]

    @ti.func
    def add(self, entry, count):
        """Add `count`, which is not negative and at most 2^32 - 1, to an entry."""
        more = ti.cast(count, ti.u32)
        if ti.static(self.alone):
            before = self.low[entry]
            self.low[entry] = before + more
            if before + more < before:
                self.high[entry] = self.high[entry] + ti.u32(1)
        else:
            before = ti.atomic_add(self.low[entry], more)
            if before + more < before:
                ti.atomic_add(self.high[entry], ti.u32(1))

    def values(self) -> np.ndarray:
        """Return the counts as 64-bit integers, (count,)."""
        low, high = (field.to_numpy().astype(np.int64) for field in (self.low, self.high))
        return low + (high << 32)

    def take(self) -> np.ndarray:
        """Return the counts and begin with 0 again."""
        halves = np.empty((2, *self.low.shape), np.uint32)
        self.hand_out(halves)
        return halves[0].astype(np.int64) + (halves[1].astype(np.int64) << 32)

    @ti.kernel
    def hand_out(self, halves: ti.types.ndarray()):  # one to compile and to launch, instead of two reads and two fills
        for k in self.low:
            halves[0, k], halves[1, k] = self.low[k], self.high[k]
            self.low[k] = self.high[k] = ti.u32(0)

    def clear(self) -> None:
        """Begin with 0 again."""
        self.low.fill(0)
        self.high.fill(0)

    def __int__(self) -> int:
        """Return the first count, where there is one only; it reads two numbers of the device."""
        fields: tuple[Any, Any] = (self.low, self.high)
        low, high = (int(field[0]) & 0xFFFFFFFF for field in fields)
        return low + (high << 32)
