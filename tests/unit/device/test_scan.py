import numpy as np
import pytest

from taichi_rts.device.backend import ti
from taichi_rts.device.scan import ExclusiveScan


@pytest.mark.parametrize("size", [1, 32, 33, 5000])
def test_starts_are_the_sums_before(taichi_cpu, size):
    counts, starts = ti.field(ti.i32, size), ti.field(ti.i32, size + 1)
    scan = ExclusiveScan(counts, starts)
    rng = np.random.default_rng(size)
    for _ in range(2):  # twice: nothing may be left over from the first
        values = rng.integers(0, 50, size).astype(np.int32)
        counts.from_numpy(values)
        scan.run()
        assert starts.to_numpy().tolist() == [0, *np.cumsum(values).tolist()]
        assert scan.total[None] == values.sum()
        assert counts.to_numpy().tolist() == values.tolist()


def test_wrong_length_is_refused(taichi_cpu):
    with pytest.raises(ValueError, match="starts has 5 entries; counts has 5, so it needs 6"):
        ExclusiveScan(ti.field(ti.i32, 5), ti.field(ti.i32, 5))
