import math

import pytest

from taichi_rts.errors import TimeError
from taichi_rts.solver.stepping.timeline import MAX_TICKS, Timeline


def test_time_is_recomputed_from_the_tick_count():
    clock = Timeline(0.1, now=3_000_000)
    assert clock.time == 3_000_000 * 0.1


@pytest.mark.parametrize("tick", [0.1, 1e-3, 1 / 3, 7.3e-5])
def test_a_whole_number_of_ticks_is_reached_despite_rounding(tick):
    clock = Timeline(tick)
    for n in (1, 3, 7, 10, 999, 123_457):
        assert clock.ticks_until(n * tick) == n
        assert clock.ticks_until(sum([tick] * n) if n < 1000 else n * tick) == n
        assert clock.ticks_until((n + 0.5) * tick) == n
        assert clock.ticks_until((n - 1e-6) * tick) == n - 1


def test_zero_is_no_tick():
    assert Timeline(0.1).ticks_until(0.0) == 0


@pytest.mark.parametrize("time", [math.nan, math.inf, -math.inf, -1e-9])
def test_impossible_times_are_refused_with_value_and_remedy(time):
    with pytest.raises(TimeError, match=rf"time {time!r} s is not a finite time >= 0; give"):
        Timeline(0.1).ticks_until(time)


def test_too_long_a_run_names_the_limit():
    clock = Timeline(1e-3)
    assert clock.ticks_until(MAX_TICKS * 1e-3) == MAX_TICKS
    with pytest.raises(TimeError, match=r"time 2e\+06 s is beyond the longest run of 1\.07374e\+06 s; use a coarser"):
        clock.ticks_until(2e6)
