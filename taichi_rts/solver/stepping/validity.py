"""The paper's scheme: every particle has a validity of its own (Goswami & Batty 2014, Algorithm 1, lines 10-16)."""

from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.device.fields import Declared, integers
from taichi_rts.solver.stepping.regions import RegionalSchedule


@ti.data_oriented
class ValidityByParticle(RegionalSchedule):
    """Every base step is looked at: a particle is due when its validity has run out or its block has another level (line 12).

    validity = level - (now - updated), so that no particle has to count it down (lines 14-16).
    """

    @classmethod
    def fields(cls, settled: Any, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields for so many particles and blocks; `flag` is the compute flag of the particle at a place."""
        return super().fields(settled, particles, blocks, serial=serial) + integers(particles, "flag")

    @ti.func
    def update_validity(self, block, now, passed):
        """Lines 10-16 for the particles of `block`. All take the level of their block."""
        first, end = self.grid.first(block), self.grid.first(block + 1)
        level = self.block_level[block]
        count = 0
        for k in range(first, end):
            i = self.grid.order[k]
            own = self.particles.level[i]
            flag = ti.cast(own - (now - self.particles.updated[i]) <= 0 or own != level, ti.i32)
            if own != level:
                self.particles.level[i] = level
            self.flag[k] = flag
            count += flag
        self.block_due[block] = count
        self.add(self.occupancy, level, (end - first) * passed)
        self.add(self.updates, level, count)

    @ti.func
    def is_due(self, block, k):
        """Whether the particle at place `k` is due."""
        return self.flag[k] == 1
