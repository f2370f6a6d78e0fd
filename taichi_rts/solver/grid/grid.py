"""The dense block grid: blocks of side r, each cut along x into cells; counting sort, cell ranges, neighbour sums.

Blocks are the unit of the paper (one step per block). Cells are finer along x only: particles sorted by cell with x
fastest make the neighbours of a particle in one row one contiguous range, and finer cells make that range shorter.
"""

import numpy as np

from taichi_rts.device.backend import on_cpu, ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.device.fields import Declared, Part, integers, within
from taichi_rts.device.scan import ExclusiveScan
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.grid.resorting import Resorting


@ti.data_oriented
class BlockGrid(Part):
    """Sorts the `alive[None]` first of up to `count` particles (all, if `alive` is None) into cells.

    `order[k]` is the particle at place k; cell c holds places `start[c] .. start[c+1]`. `occupied` lists the blocks that hold
    particles, ascending, `occupied_count[None]` of them.

    Within a cell particles stand in order of their id, so the result depends on positions alone: not on threads, not on
    history. On a GPU it is a counting sort, with two passes over the particles and two over the cells; on a CPU `Resorting`
    changes the previous order.
    """

    cells_each = CELLS_PER_BLOCK
    transient = frozenset(
        {
            "rank",
            "cell_count",
            "vacated",
            "vacated_count",
            "serial",
            "resorting",
            "scan",
            "occupied_flag",
            "occupied_start",
            "occupied_scan",
        }
    )

    def __init__(self, geometry: Geometry, count: int, alive: ti.Field | None = None) -> None:
        self.geometry = geometry
        self.alive = ti.field(ti.i32, ()) if alive is None else alive
        if alive is None:
            self.alive[None] = count
        self.serial = on_cpu()
        self.make_fields(self.order_fields(count))
        self.cell_of.fill(-1)
        self.order.from_numpy(np.arange(count, dtype=np.int32))
        self.make_fields(self.block_fields(count, geometry.blocks, serial=self.serial))
        if self.serial:
            self.resorting = Resorting(self, count)
            self.occupied_count = ti.field(ti.i32, ())
        else:
            self.scan = ExclusiveScan(self.cell_count, self.start)
            self.occupied_scan = ExclusiveScan(self.occupied_flag, self.occupied_start)
            self.occupied_count = self.occupied_scan.total
        self.tracks_arrivals = self.tracks_vacated = False

    @staticmethod
    def order_fields(count: int) -> list[Declared]:
        """Declare the fields with an entry for each of `count` particles."""
        return integers(count, "cell_of", "rank", "order")

    @staticmethod
    def block_fields(count: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the other fields for `count` particles in `blocks` blocks; `serial`: on a CPU."""
        cells = blocks * CELLS_PER_BLOCK
        declared = [*integers(cells, "cell_count"), *integers(cells + 1, "start"), *integers(blocks, "occupied")]
        if serial:
            return declared + within("resorting", Resorting.fields(count, blocks))
        scans = within("scan", ExclusiveScan.fields(cells)) + within("occupied_scan", ExclusiveScan.fields(blocks))
        return [*declared, *integers(blocks, "occupied_flag"), *integers(blocks + 1, "occupied_start"), *scans]

    @staticmethod
    def arrival_fields(blocks: int) -> list[Declared]:
        """Declare what `track_arrivals` makes."""
        return integers(blocks, "arrived")

    @staticmethod
    def vacated_fields(blocks: int) -> list[Declared]:
        """Declare what `track_vacated` makes."""
        return integers(blocks, "vacated")

    def track_arrivals(self) -> None:
        """From now on note in `arrived`, (blocks,), by a 1 which blocks a particle has come into; readers reset it.

        Now and then, after particles were reordered in memory, all blocks are marked. Has to be called before the
        first sort.
        """
        self.tracks_arrivals = True
        self.make_fields(self.arrival_fields(self.geometry.blocks))

    def track_vacated(self) -> None:
        """From now on list in `vacated` the `vacated_count[None]` blocks that have become empty since the last update.

        Has to be called before the first sort.
        """
        if not self.tracks_vacated:
            self.tracks_vacated = True
            self.make_fields(self.vacated_fields(self.geometry.blocks))
            self.vacated_count = ti.field(ti.i32, ())

    def forget(self) -> None:
        """Take note that particles have other entries now: none is where its entry was, so all count as new in their blocks."""
        self.cell_of.fill(-1)
        self.start.fill(0)
        self.restored()

    def divide(self, blocks: int) -> None:
        """Take note that only the first `blocks` may hold particles (`Tiles`); to be called before `restored`."""
        if self.serial:
            self.resorting.divide(blocks)

    def restored(self) -> None:
        """Take note that what is not transient has been put back to what it was at another time."""
        if self.serial:
            self.resorting.restored()

    @ti.func
    def insert_all(self, locate: ti.template(), now, tick):
        """`insert` every particle `i` at `locate(i, now, tick)` [m]; to be called at the outermost level of a kernel.

        That, or an `insert` of every particle, and then `sort`, sorts anew.
        """
        if ti.static(self.serial):
            self.resorting.insert_all(locate, now, tick)
        else:
            for i in range(self.alive[None]):
                self.insert(i, locate(i, now, tick))

    @ti.func
    def insert(self, i, x):
        """Count particle `i` at position `x` [m] into its cell."""
        cell = self.geometry.cell(x)
        if self.cell_of[i] != cell:
            self.change(i, cell)
        if ti.static(not self.serial):
            self.rank[i] = ti.atomic_add(self.cell_count[cell], 1)

    @ti.func
    def change(self, i, cell):
        """Note that particle `i`, which was in another cell, is in `cell` now."""
        before = self.cell_of[i]
        self.cell_of[i] = cell
        if ti.static(self.tracks_arrivals):
            if self.block_of(before) != self.block_of(cell):
                self.arrived[self.block_of(cell)] = 1
        if ti.static(self.serial):
            self.resorting.insert(i, before, cell)

    @ti.func
    def sort(self, identity: ti.template()):
        """Sort all that have been inserted, in a cell in the order of `identity`, at the outermost level of a kernel."""
        if ti.static(self.serial):
            self.resorting.sort(identity)
            if ti.static(self.tracks_vacated):
                self.list_vacated()
            self.resorting.finish()
        else:
            self.scan.scan()
            for i in range(self.alive[None]):
                self.order[self.start[self.cell_of[i]] + self.rank[i]] = i
            if ti.static(self.tracks_vacated):
                self.list_vacated()
            self.list_occupied()
            for m in range(self.occupied_count[None]):
                for part in range(CELLS_PER_BLOCK):
                    self.sort_cell(identity, self.occupied[m] * CELLS_PER_BLOCK + part)

    @ti.func
    def sort_cell(self, identity: ti.template(), cell):
        """Bring the particles of a cell into the order of their ids."""
        self.cell_count[cell] = 0  # for the next update
        first = self.start[cell]
        for k in range(first + 1, self.start[cell + 1]):  # insertion sort: a cell holds a handful
            particle = self.order[k]
            key = identity[particle]
            m = k - 1
            while m >= first and identity[self.order[m]] > key:
                self.order[m + 1] = self.order[m]
                m -= 1
            self.order[m + 1] = particle

    @ti.func
    def list_vacated(self):
        """Find the blocks that were occupied and no longer are."""
        self.vacated_count[None] = 0
        for m in range(self.occupied_count[None]):
            if self.is_empty(self.occupied[m]):
                self.vacated[ti.atomic_add(self.vacated_count[None], 1)] = self.occupied[m]

    @ti.func
    def list_occupied(self):
        """Find the blocks that are occupied."""
        for block in range(self.geometry.blocks):
            self.occupied_flag[block] = ti.cast(not self.is_empty(block), ti.i32)
        self.occupied_scan.scan()
        for block in range(self.geometry.blocks):
            if self.occupied_flag[block] == 1:
                self.occupied[self.occupied_start[block]] = block

    @ti.func
    def is_empty(self, block):
        """Whether a block held no particle at the last update."""
        return self.first(block) == self.first(block + 1)

    @ti.func
    def block(self, i):
        """Index of the block that held particle `i` at the last update."""
        return self.block_of(self.cell_of[i])

    @ti.func
    def block_of(self, cell):
        """Index of the block that `cell` is part of."""
        return cell // CELLS_PER_BLOCK

    @ti.func
    def first(self, block):
        """First place of a block's particles; the first of block + 1 ends them."""
        return self.start[block * CELLS_PER_BLOCK]
