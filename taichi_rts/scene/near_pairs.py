"""Pairs of particles near each other in NumPy: how many a particle has, and whether any are too near."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np


def near_pairs(
    x: np.ndarray, support: float, others: np.ndarray | None = None
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield places i in `x`, j in `others`, and squared distances [m^2], (P,) each, of the pairs nearer than `support` [m].

    Positions `x` and `others` [m] are (N, dim) and (M, dim); without `others` pairs are within `x`: each then comes twice, and
    every particle once with itself. Points are sorted into cells of side `support`; each looks through its own and the adjacent
    cells, one after the other. Images across periodic faces are not looked at.
    """
    y = x if others is None else others
    if not len(x) or not len(y):
        return
    lowest = np.minimum(x.min(axis=0), y.min(axis=0))
    cells = [np.floor((points - lowest) / support).astype(np.int64) + 1 for points in (x, y)]
    shape = np.maximum(cells[0].max(axis=0), cells[1].max(axis=0)) + 2  # an empty layer around, so that no index wraps
    strides = np.cumprod(np.concatenate([[1], shape[:0:-1]]))[::-1]
    keys = [cell @ strides for cell in cells]
    mine, theirs = (np.argsort(key, kind="stable") for key in keys)
    wanted, there = keys[0][mine], keys[1][theirs]
    one, two = x[mine].astype(np.float64), y[theirs].astype(np.float64)
    for offset in itertools.product((-1, 0, 1), repeat=x.shape[1]):
        cell = wanted + int(np.dot(offset, strides))
        first, end = np.searchsorted(there, cell, "left"), np.searchsorted(there, cell, "right")
        counts = end - first
        i = np.repeat(np.arange(len(x)), counts)
        j = np.arange(len(i)) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(first, counts)
        distance2 = ((one[i] - two[j]) ** 2).sum(axis=1)
        near = distance2 < support**2
        yield mine[i[near]], theirs[j[near]], distance2[near]


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
