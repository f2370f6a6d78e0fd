"""Energy that changes of gravity put in: fluid that stays where it is has another potential energy under another gravity."""

from __future__ import annotations

import numpy as np

from taichi_rts.readings.reading import Reading
from taichi_rts.scene.parts.gravity import GravityTable

MOST_STEPS = 32
"""Base steps between two readings of a gravity that keeps changing: water then moves by 1.3 r at most at Mach 0.1."""


def next_look(table: GravityTable, present: float, until: float, look: Reading | None, reach: float) -> float | None:
    """Time [s] up to `until` [s] of the next reading that the work of `table` needs, None if it needs none.

    Changes nearer to each other than `reach` [s] share their readings, so that their number does not count.
    """
    if table.linear:
        end = min(until, present + reach, float(table.times[-1]))
        return end if end > present else None
    changes = table.between(present, until)
    if not len(changes):
        return None
    near = changes[changes <= present + reach] if look else changes[:1]
    return float(near[-1] if len(near) else changes[0])


def work_between(table: GravityTable, before: Reading, after: Reading) -> float:
    """Work [J] of what changes gravity after the time of one reading and not after that of another, or at it if both are one.

    The potential energy is -g.S with the first moment of mass S = sum of m x, so the work is the integral of -S dg. S is
    interpolated by the cubic with the values and slopes (the momentum) of both readings; where gravity is linear in time the
    integral over each piece is Simpson's, exact for a cubic.
    """
    if not table.linear:
        changes = table.between(before.time, after.time) if after is not before else np.array([after.time])
        rows = np.searchsorted(table.times, changes)
        return -float((_first_moment(changes, before, after) * (table.values[rows] - table.values[rows - 1])).sum())
    times = np.unique([before.time, *table.between(before.time, after.time), after.time])
    gained = np.diff(table.at(times), axis=0)
    ends, middles = (_first_moment(t, before, after) for t in (times, 0.5 * (times[1:] + times[:-1])))
    return -float(((ends[:-1] + 4.0 * middles + ends[1:]) / 6.0 * gained).sum())


def _first_moment(times: np.ndarray, before: Reading, after: Reading) -> np.ndarray:
    """First moment of mass [kg m], (T, dim), at `times` [s], (T,), by the two readings around them."""
    length = after.time - before.time
    if length <= 0.0:
        return np.tile(after.first_moment, (len(times), 1))
    u = ((times - before.time) / length)[:, None]
    back, on = 1.0 - u, u
    return back**2 * ((1.0 + 2.0 * u) * before.first_moment + u * length * before.momentum) + on**2 * (
        (3.0 - 2.0 * u) * after.first_moment - back * length * after.momentum
    )
