"""Limits between neighbouring blocks: how much longer than its neighbours' a block's step may be."""

import taichi as ti

from taichi_rts.grid import Geometry


@ti.data_oriented
class BlockLimiter:
    """Lowers the level of a block to its smallest neighbour's plus `jump`, for the 8 (26) blocks around it.

    `jump = 0` is the paper's R_min: the outer layer of the slower side takes the faster side's step. `jump = 1` is one
    sweep of grading (Saitoh & Makino 2009 limit neighbours in the same spirit). Empty blocks (level `EMPTY`) limit nobody.
    """

    EMPTY = 1 << 20

    def __init__(self, geometry: Geometry) -> None:
        self.strides = geometry.neighbour_strides
        self.blocks = geometry.blocks

    @ti.kernel
    def limit(self, source: ti.template(), target: ti.template(), jump: ti.i32):
        """Write the limited levels of `source` to `target`, (blocks,) both."""
        for block in range(self.blocks):
            level = source[block]
            if level != self.EMPTY:
                for stride in ti.static(self.strides):
                    level = ti.min(level, source[block + stride] + jump)
            target[block] = level
