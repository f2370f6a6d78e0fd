"""Pairs of particles near each other in NumPy: how many a particle has, and whether any are too near."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np


def near_pairs(x: np.ndarray, support: float) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield places i, j and squared distances [m^2], (P,) each, of the pairs nearer than `support` [m]; `x` [m] is (N, dim).

    Each pair comes twice, each particle once with itself. Particles are sorted into cells of side `support`; each looks through
    its own and the adjacent cells, one after the other. Images across periodic faces are not looked at.
    """
    n, dim = x.shape
    if n == 0:
        return
    cell = np.floor((x - x.min(axis=0)) / support).astype(np.int64) + 1  # an empty layer around, so that no index wraps
    shape = cell.max(axis=0) + 2
    strides = np.cumprod(np.concatenate([[1], shape[:0:-1]]))[::-1]
    key = cell @ strides
    order = np.argsort(key, kind="stable")
    ordered, places = key[order], x[order].astype(np.float64)
    for offset in itertools.product((-1, 0, 1), repeat=dim):
        other = ordered + int(np.dot(offset, strides))
        first, end = np.searchsorted(ordered, other, "left"), np.searchsorted(ordered, other, "right")
        counts = end - first
        i = np.repeat(np.arange(n), counts)
        j = np.arange(len(i)) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(first, counts)
        distance2 = ((places[i] - places[j]) ** 2).sum(axis=1)
        near = distance2 < support**2
        yield order[i[near]], order[j[near]], distance2[near]


def mean_neighbours(x: np.ndarray, support: float) -> float:
    """Mean number of other fluid particles within `support` [m] of a particle; `x` [m] is (N, dim). Walls are not counted."""
    n = len(x)
    return (sum(len(i) for i, _, _ in near_pairs(x, support)) - n) / n if n else 0.0


def nearest_pair(x: np.ndarray, limit: float) -> tuple[float, int, int] | None:
    """Return distance [m] and places of the two of `x` [m], (N, dim), that are nearest to each other, if below `limit` [m]."""
    found = None
    for i, j, distance2 in near_pairs(x, limit):
        apart = np.flatnonzero(i < j)
        if len(apart):
            k = int(apart[np.argmin(distance2[apart])])
            if found is None or distance2[k] < found[0]:
                found = float(distance2[k]), int(i[k]), int(j[k])
    return None if found is None else (float(np.sqrt(found[0])), found[1], found[2])


def mean_occupancy(x: np.ndarray, side: float) -> float:
    """Mean number of particles, itself included, in a particle's cell of side `side` [m]: cheaper than counting neighbours."""
    cell = np.floor((x - x.min(axis=0)) / side).astype(np.int64)
    counts = np.unique(cell @ np.cumprod([1, *(cell.max(axis=0) + 1)[:-1]]), return_counts=True)[1]
    return float((counts**2).sum() / len(x))
