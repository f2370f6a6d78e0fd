"""What lies in the blocks around every occupied block, reduced: the smallest step beside it, the largest sound speed."""

from taichi_rts.device.backend import CHUNK, threads, ti
from taichi_rts.solver.grid.grid import BlockGrid

TASKS = 4  # shares of the occupied blocks for each thread; they are taken one by one


@ti.data_oriented
class Surroundings:
    """Visits the occupied blocks of `grid`, each with the least or largest of what the 8 (26) blocks around it have.

    Occupied blocks come in runs along x. On a CPU a thread keeps what it has found of three columns of blocks, of 3 (9) each, and
    reads one more as it goes on along the run: 9 reads instead of 26.
    """

    transient = frozenset({"in_runs", "tasks"})

    def __init__(self, grid: BlockGrid) -> None:
        self.grid = grid
        self.geometry = grid.geometry
        self.in_runs = grid.serial and not self.geometry.repeats
        self.tasks = TASKS * threads()
        rows = self.geometry.across_count
        self.others = [k for k in range(rows) if k != rows // 2]
        """Rows in which the other blocks of a column across x lie."""

    @ti.func
    def visit(self, wanted: ti.template(), smallest: ti.template(), rest):
        """Call `wanted.finish(block, around)` for every occupied block.

        `around` is the smallest, or with `smallest` False the largest, of `wanted.read(other)` of the blocks around it, and not
        beyond `rest`. To be called at the outermost level of a kernel, where its loops run in parallel.
        """
        if ti.static(self.in_runs):
            for turn in range(self.tasks * CHUNK):  # the first iteration of each chunk does a share
                m, end = 0, 0
                if turn % CHUNK == 0:
                    count = self.grid.occupied_count[None]
                    m, end = count * (turn // CHUNK) // self.tasks, count * (turn // CHUNK + 1) // self.tasks
                last = -1
                before, own, here, next_own, next_here = rest, rest, rest, rest, rest
                while m < end:
                    block = self.grid.occupied[m]
                    if block == last + 1:
                        before = self.further(smallest, own, here)
                        own, here = next_own, next_here
                    else:
                        before = self.further(
                            smallest, wanted.read(block - 1), self.column(wanted, smallest, block - 1, rest)
                        )
                        own, here = wanted.read(block), self.column(wanted, smallest, block, rest)
                    next_own, next_here = wanted.read(block + 1), self.column(wanted, smallest, block + 1, rest)
                    around = self.further(smallest, self.further(smallest, before, here), next_own)
                    wanted.finish(block, self.further(smallest, around, next_here))
                    last = block
                    m += 1
        else:
            for m in range(self.grid.occupied_count[None]):
                block = self.grid.occupied[m]
                around = rest
                for k in ti.static(range(len(self.geometry.offsets))):
                    around = self.further(smallest, around, wanted.read(self.geometry.beside(block, k)))
                wanted.finish(block, around)

    @ti.func
    def column(self, wanted: ti.template(), smallest: ti.template(), block, rest):
        """Reduce what the others in the column across x of `block` have."""
        found = rest
        for k in ti.static(self.others):
            found = self.further(smallest, found, wanted.read(self.geometry.across(block, k)))
        return found

    @ti.func
    def further(self, smallest: ti.template(), one, two):
        """The smaller or larger of two values."""
        return ti.min(one, two) if ti.static(smallest) else ti.max(one, two)
