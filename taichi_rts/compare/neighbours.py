"""Counting neighbours in NumPy, for the number of pair interactions."""

from __future__ import annotations

import itertools

import numpy as np


def mean_neighbours(x: np.ndarray, support: float) -> float:
    """Mean number of other fluid particles within `support` [m] of a particle; `x` [m] is (N, dim).

    Particles are sorted into cells of side `support`; each looks through its own and the adjacent cells. Wall particles and
    images across periodic faces are not counted.
    """
    n, dim = x.shape
    if n == 0:
        return 0.0
    cell = np.floor((x - x.min(axis=0)) / support).astype(np.int64) + 1  # an empty layer around, so that no index wraps
    shape = cell.max(axis=0) + 2
    strides = np.cumprod(np.concatenate([[1], shape[:0:-1]]))[::-1]
    key = cell @ strides
    order = np.argsort(key, kind="stable")
    ordered, places = key[order], x[order].astype(np.float64)
    pairs = 0
    for offset in itertools.product((-1, 0, 1), repeat=dim):
        other = ordered + int(np.dot(offset, strides))
        first, end = np.searchsorted(ordered, other, "left"), np.searchsorted(ordered, other, "right")
        counts = end - first
        i = np.repeat(np.arange(n), counts)
        j = np.arange(len(i)) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(first, counts)
        pairs += int((((places[i] - places[j]) ** 2).sum(axis=1) < support**2).sum())
    return (pairs - n) / n
