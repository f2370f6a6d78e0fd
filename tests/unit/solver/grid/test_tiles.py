"""Blocks that are kept only near particles: numbering and neighbours as if all were kept."""

import numpy as np
import pytest

from taichi_rts.device.backend import ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.grid.tiles import OUTSIDE, TILE, Tiles, slots_for

BOXES = {
    2: ((0.0, -1.0), (7.3, 3.0)),
    3: ((0.0, -1.0, 2.0), (7.3, 2.0, 4.1)),
}


@ti.data_oriented
class Probe:
    def __init__(self, tiles, all_blocks):
        self.tiles, self.all_blocks = tiles, all_blocks

    @ti.kernel
    def look(self, x: ti.types.ndarray(ndim=2), found: ti.types.ndarray(ndim=2), wanted: ti.types.ndarray(ndim=2)):
        """Of each point: cell over all, whether it is safe, numbers of the blocks around; and what they are in the whole grid."""
        for n in range(x.shape[0]):
            place = ti.Vector([x[n, d] for d in ti.static(range(self.tiles.dim))])
            cell, expected = self.tiles.cell(place), self.all_blocks.cell(place)
            block, other = cell // CELLS_PER_BLOCK, expected // CELLS_PER_BLOCK
            found[n, 0] = self.tiles.number(block) * CELLS_PER_BLOCK + cell % CELLS_PER_BLOCK
            wanted[n, 0] = expected
            found[n, 1], wanted[n, 1] = ti.cast(self.tiles.safe(cell), ti.i32), 1
            found[n, 2], wanted[n, 2] = (
                self.tiles.step(block, self.tiles.dim - 1),
                self.all_blocks.step(other, self.tiles.dim - 1),
            )
            for k in ti.static(range(len(self.tiles.offsets))):
                found[n, 3 + k] = self.tiles.number(self.tiles.beside(block, k))
                wanted[n, 3 + k] = self.all_blocks.beside(other, k)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_blocks_around_particles_are_those_of_the_whole_grid(dim, taichi_cpu):
    lower, upper = BOXES[dim]
    rng = np.random.default_rng(4)
    x = rng.uniform(lower, upper, (60, dim)).astype(np.float32)
    x[:2] = lower, upper
    tiles, all_blocks = Tiles(lower, upper, 0.2, 0.0, 3 * len(x)), Geometry(lower, upper, 0.2)
    numbers = all_blocks.cell_numpy(x.astype(float)) // CELLS_PER_BLOCK
    tiles.keep(tiles.keys_around(numbers, 1))
    tiles.keep(tiles.keys_around(numbers, 2))  # again, where some are kept already
    found, wanted = (np.zeros((len(x), 3 + 3**dim - 1), np.int32) for _ in range(2))
    Probe(tiles, all_blocks).look(x, found, wanted)
    np.testing.assert_array_equal(found, wanted)
    assert (np.diff(tiles.keys()) > 0).all()
    assert len(tiles.keys()) < tiles.tiles * tiles.rows


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("margin", [1, 2])
def test_tiles_around_blocks(dim, margin, taichi_cpu):
    lower, upper = BOXES[dim]
    tiles = Tiles(lower, upper, 0.2, 0.0, 3)
    steps = np.array([np.ones(dim), np.array(tiles.shape) - 2, [5, 7, 4][:dim]], int)
    strides = np.array(tiles.block_strides)
    wanted = set()
    for step in steps:
        for offset in np.ndindex(*[2 * margin + 1] * dim):
            near = np.clip(step + offset - margin, 0, np.array(tiles.shape) - 1)
            row = int(near[1:] @ strides[1:]) // tiles.shape[0]
            wanted.add(row * tiles.tiles + near[0] // TILE)
    assert tiles.keys_around(steps @ strides, margin).tolist() == sorted(wanted)


def test_slots_suffice_for_particles_far_apart():
    assert slots_for(10, (1000, 1000, 1000)) == 10 * 19 + OUTSIDE
    assert slots_for(10, (1000, 1000)) == 10 * 7 + OUTSIDE
    assert slots_for(10_000, (10, 10, 10)) == 3 * 100 + OUTSIDE  # no more than there are
