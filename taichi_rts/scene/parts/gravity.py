"""Gravity as a function of time: a table of the moments at which a scene changes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class GravityTable:
    """Gravity `values` [m/s^2], (K, dim), from the `times` [s], (K,), on, of which the first is 0.

    It stays the same until the next time, or if `linear` changes at a constant rate until then; after the last it is constant.
    """

    times: np.ndarray
    values: np.ndarray
    linear: bool

    @property
    def rates(self) -> np.ndarray:
        """Rates of change [m/s^3], (K, dim), from each time on, of a linear table."""
        steps = np.diff(self.values, axis=0) / np.diff(self.times)[:, None]
        return np.concatenate([steps, np.zeros_like(self.values[:1])])

    def at(self, times: np.ndarray) -> np.ndarray:
        """Gravity [m/s^2], (T, dim), at `times` [s], (T,), none of them negative."""
        if self.linear:
            return np.stack([np.interp(times, self.times, column) for column in self.values.T], axis=1)
        found: np.ndarray = self.values[np.searchsorted(self.times, times, side="right") - 1]
        return found

    def between(self, start: float, end: float) -> np.ndarray:
        """Times [s] of the table after `start` and not after `end` [s]."""
        first, last = np.searchsorted(self.times, [start, end], side="right")
        found: np.ndarray = self.times[first:last]
        return found
