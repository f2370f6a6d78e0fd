"""Where moving walls are when a particle looks at them."""

from collections.abc import Sequence
from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.particles.extra import Extra


@ti.data_oriented
class WallObserver(Extra):
    """Notes for every particle that is due where the moving faces and obstacles are at its time."""

    def __init__(self, walls: Sequence[Any], grid: BlockGrid) -> None:
        self.walls = list(walls)
        self.grid = grid

    def before_forces(self, schedule: Any, now: int, tick: float) -> None:
        """Note it."""
        self.observe(schedule, now, tick)

    @ti.kernel
    def observe(self, due: ti.template(), now: ti.i32, tick: float):
        for n in range(due.due_count[None]):
            k = due.due[n]
            present = now + due.read_at[self.grid.block(self.grid.order[k])]
            for wall in ti.static(self.walls):
                wall.observe(k, present, tick)
