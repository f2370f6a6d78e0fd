"""Exclusive prefix sums in kernels. Taichi's own `PrefixSumExecutor` refuses the CPU and is wrong on lavapipe."""

import math

from taichi_rts.device.backend import ti
from taichi_rts.device.fields import Declared, Part, integers


@ti.data_oriented
class ExclusiveScan(Part):
    """Turns counts into starts: `starts[k] = sum(counts[:k])`, `starts[n]` and `total[None]` the sum of all.

    Two levels of about sqrt(n) entries: chunks in parallel, one thread over the chunks' sums, chunks in parallel.
    """

    transient = frozenset({"counts", "sums"})

    def __init__(self, counts: ti.Field, starts: ti.Field) -> None:
        self.n = counts.shape[0]
        if starts.shape[0] != self.n + 1:
            raise ValueError(f"starts has {starts.shape[0]} entries; counts has {self.n}, so it needs {self.n + 1}")
        self.counts = counts
        self.starts = starts
        self.chunk = self.chunk_of(self.n)
        self.chunks = -(-self.n // self.chunk)
        self.make_fields(self.fields(self.n))
        self.total = ti.field(ti.i32, ())

    @staticmethod
    def chunk_of(n: int) -> int:
        """Return the length of a chunk of `n` counts."""
        return max(32, math.isqrt(n) + 1)

    @classmethod
    def fields(cls, n: int) -> list[Declared]:
        """Declare the fields for `n` counts, without these and their starts."""
        return integers(-(-n // cls.chunk_of(n)), "sums")

    def run(self) -> None:
        """Fill `starts` and `total` from `counts`."""
        self.run_alone()

    @ti.kernel
    def run_alone(self):
        self.scan()

    @ti.func
    def scan(self):
        """Do the same at the outermost level of a kernel: a launch costs as much as each of the loops."""
        for c in range(self.chunks):
            total = 0
            for k in range(c * self.chunk, ti.min((c + 1) * self.chunk, self.n)):
                total += self.counts[k]
            self.sums[c] = total
        ti.loop_config(serialize=True)
        for _ in range(1):
            running = 0
            for c in range(self.chunks):
                count = self.sums[c]
                self.sums[c] = running
                running += count
            self.total[None] = running
            self.starts[self.n] = running
        for c in range(self.chunks):
            running = self.sums[c]
            for k in range(c * self.chunk, ti.min((c + 1) * self.chunk, self.n)):
                count = self.counts[k]
                self.starts[k] = running
                running += count
