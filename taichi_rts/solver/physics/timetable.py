"""Motions on the device's clock: how far a piece of one has come, without ever rounding the time since the start of the run.

A time in single precision is known to 6e-8 of itself: after 10 s to a few per cent of a step, after an hour to several steps. So
moments are kept as a whole number of ticks and a remainder, and only what has passed since then is turned into seconds.
"""

from typing import Any

import numpy as np

from taichi_rts.device.backend import ti

LAST = 2**31 - 1
"""Tick of all moments beyond the end of any run."""
SNAP = 1e-6
"""A moment nearer than this to a tick, in ticks, is that tick: rounding must not delay it by a step."""


class Ticking:
    """A part whose numbers depend on the length of a tick, which it is given before it is used."""

    def count_in(self, tick: float) -> None:
        """Take a `tick` [s]; in double precision, on the host."""
        raise NotImplementedError


def store(field: Any, values: np.ndarray) -> None:
    """Write `values` to a field of reals, in its precision."""
    field.from_numpy(values.astype(np.float32 if field.dtype == ti.f32 else np.float64))


@ti.data_oriented
class Timetable(Ticking):
    """When the P pieces of a motion begin and end. All times [s] that are asked for are `ahead` after tick `now`.

    `starts` and `durations` [s], (P,), in ascending order and without overlap.
    """

    transient = frozenset({"starts", "ends"})

    def __init__(self, starts: Any, durations: Any) -> None:
        self.starts = np.asarray(starts, float)
        self.ends = self.starts + np.asarray(durations, float)
        self.count = len(self.starts)
        self.first, self.last = (ti.field(ti.i32, self.count) for _ in range(2))
        """Ticks at or before which the pieces begin and end."""
        self.first_rest, self.last_rest = (ti.field(float, self.count) for _ in range(2))
        """What is missing from there [s]."""

    def count_in(self, tick: float) -> None:
        """Take a `tick` [s]."""
        for moments, whole, rest in (
            (self.starts, self.first, self.first_rest),
            (self.ends, self.last, self.last_rest),
        ):
            ticks = np.minimum(np.floor(moments / tick + SNAP), LAST)
            remainder = np.where(ticks < LAST, moments - ticks * tick, 0.0)
            whole.from_numpy(ticks.astype(np.int32))
            store(rest, np.where(np.abs(remainder) < SNAP * tick, 0.0, remainder))

    @ti.func
    def since_start(self, n, now, tick, ahead):
        """Time [s] since piece `n` has begun, negative before."""
        return ti.cast(now - self.first[n], float) * tick + (ahead - self.first_rest[n])

    @ti.func
    def since_end(self, n, now, tick, ahead):
        """Time [s] since piece `n` has ended, negative before."""
        return ti.cast(now - self.last[n], float) * tick + (ahead - self.last_rest[n])

    @ti.func
    def piece(self, now, tick, ahead):
        """Number of the last piece that has begun, of the first if none has."""
        low, high = 0, self.count
        while high - low > 1:
            middle = (low + high) // 2
            if self.since_start(middle, now, tick, ahead) >= 0.0:
                low = middle
            else:
                high = middle
        return low

    @ti.func
    def lasts(self, n, now, tick, ahead):
        """Whether piece `n` has begun and has not ended."""
        return self.since_start(n, now, tick, ahead) >= 0.0 and self.since_end(n, now, tick, ahead) < 0.0

    @ti.func
    def lasted(self, n, now, tick, ahead):
        """How long piece `n` has lasted: a number of ticks, and a time [s] besides; nothing before it, all of it afterwards."""
        ticks, rest = now - self.first[n], ahead - self.first_rest[n]
        if self.since_start(n, now, tick, ahead) <= 0.0:
            ticks, rest = 0, 0.0
        elif self.since_end(n, now, tick, ahead) >= 0.0:
            ticks, rest = self.last[n] - self.first[n], self.last_rest[n] - self.first_rest[n]
        return ticks, rest


@ti.data_oriented
class Wheel(Ticking):
    """What P pieces of a motion have come round by, at constant rates: only the share of the last turn is ever worked out.

    `rates`, (P,), are in turns per second; a turn may be one of an angle or a length after which everything repeats.
    A tick's share of a turn is kept as a whole number of 2^-32 turns, whose multiples are exact modulo one turn, and a remainder.
    """

    transient = frozenset({"rates"})

    def __init__(self, rates: Any) -> None:
        self.rates = np.asarray(rates, float)
        self.step = ti.field(ti.u32, len(self.rates))
        self.remainder, self.rate = (ti.field(float, len(self.rates)) for _ in range(2))

    def count_in(self, tick: float) -> None:
        """Take a `tick` [s]."""
        share = self.rates * tick
        share -= np.floor(share)
        whole = np.rint(share * 2.0**32)
        self.step.from_numpy((whole % 2.0**32).astype(np.uint32))
        store(self.remainder, share - whole / 2.0**32)
        store(self.rate, self.rates)

    @ti.func
    def share(self, n, ticks, rest):
        """Turns, from -1/2 to 1/2, after `ticks` ticks and `rest` [s] of piece `n`, less all whole ones."""
        fixed = ti.cast(ti.cast(ticks, ti.u32) * self.step[n], ti.i32)
        turns = ti.cast(fixed, float) * 2.0**-32 + ti.cast(ticks, float) * self.remainder[n] + rest * self.rate[n]
        return turns - ti.floor(turns + 0.5)
