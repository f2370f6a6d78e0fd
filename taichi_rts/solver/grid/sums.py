"""Functions for kernels that sum over the neighbours of a point, of fluid or of a wall."""

from collections.abc import Callable, Sequence
from typing import Any

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.solver.grid.geometry import MARGIN, Geometry
from taichi_rts.solver.grid.grid import BlockGrid


def make_neighbour_sum(
    geometry: Geometry,
    start: ti.Field,
    pair: Callable[..., Any],
    width: int,
    backend: Backend,
    lanes: int | None = None,
) -> Callable[..., Any]:
    """Return a ti.func `total(i, x, cell)`: the sum of `pair(i, j)`, a vector of `width`, over all j near `x` [m].

    `cell` is the one that `x` was sorted into. j runs over places of the sorted arrays that `start` indexes; pairs beyond the
    support are offered too, so `pair` must vanish there by itself. The inner loop has a constant length on the CPU
    (`lanes`, by default `Backend.lanes`; with 1 it is a plain one, which is quicker to compile).
    """
    lanes = lanes or backend.lanes
    dtype = backend.dtype

    @ti.func
    def sum_range(i, low, high):
        total = ti.Vector.zero(dtype, width)
        if ti.static(lanes == 1):
            for j in range(low, high):
                total += pair(i, j)
        else:
            for chunk in range((high - low + (lanes - 1)) // lanes):
                part = ti.Vector.zero(dtype, width)
                base = low + chunk * lanes
                for lane in range(lanes):
                    j = base + lane
                    part += pair(i, j) * ti.cast(j < high, dtype)
                total += part
        return total

    first = MARGIN * CELLS_PER_BLOCK
    around = geometry.inside[0] * CELLS_PER_BLOCK

    @ti.func
    def sum_row(i, base, low, high):
        total = ti.Vector.zero(dtype, width)
        if ti.static(geometry.periodic[0]):
            total += sum_range(i, start[base + ti.max(low, first)], start[base + ti.min(high, first + around)])
            if low < first:
                total += sum_range(i, start[base + low + around], start[base + first + around])
            elif high > first + around:
                total += sum_range(i, start[base + first], start[base + high - around])
        else:
            total = sum_range(i, start[base + low], start[base + high])
        return total

    @ti.func
    def sum_all(i, x, cell):
        total = ti.Vector.zero(dtype, width)
        low = geometry.column(x[0] - geometry.reach)
        high = geometry.column(x[0] + geometry.reach) + 1
        if ti.static(geometry.dim == 2):
            for dy in range(-1, 2):
                total += sum_row(i, geometry.base_beside(cell, dy, 0), low, high)
        else:
            for dz in range(-1, 2):
                for dy in range(-1, 2):
                    total += sum_row(i, geometry.base_beside(cell, dy, dz), low, high)
        return total

    return sum_all


def make_wall_sum(
    walls: Sequence[Any], grid: BlockGrid, make_pair: Callable[[Any], Any], width: int, backend: Backend
) -> Callable[..., Any]:
    """Return a ti.func `total(k)`: the sum over all particles of all `walls` near the fluid at place `k`.

    `make_pair(wall)` returns the ti.func `pair(k, b)`, a vector of `width`, as `make_neighbour_sum` takes it.
    """
    walls = list(walls)
    sums = [make_neighbour_sum(wall.geometry, wall.start, make_pair(wall), width, backend) for wall in walls]

    @ti.func
    def sum_walls(k):
        total = ti.Vector.zero(backend.dtype, width)
        here = grid.cell_of[grid.order[k]]
        for w in ti.static(range(len(walls))):
            x, cell = walls[w].seen_from(k, here)
            if walls[w].near[grid.block_of(cell)] == 1:
                total += sums[w](k, x, cell)
        return total

    return sum_walls
