"""Pairs of particles near each other: how many a particle has, and whether any are too near."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

PART = 5_000
"""Particles whose pairs are found at a time, to save memory: one has some 200 in the cells around it in three dimensions."""


def near_pairs(
    x: np.ndarray, support: float, others: np.ndarray | None = None
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield places i in `x`, j in `others`, and squared distances [m^2], (P,) each, of the pairs nearer than `support` [m].

    Positions `x` and `others` [m] are (N, dim) and (M, dim); without `others` pairs are within `x`: each then comes twice, and
    every particle once with itself. Images across periodic faces are not looked at.
    """
    one = x.astype(np.float64)
    two = one if others is None else others.astype(np.float64)
    if not len(one) or not len(two):
        return
    # Cells around those of `two`, a little larger than the support, in rows along x: three of them are one range.
    lower, side = two.min(axis=0), 1.000001 * support
    cell = np.floor((two - lower) / side).astype(np.int64) + 1
    strides = np.cumprod([1, *(cell.max(axis=0) + 2)[:-1]])
    key = cell @ strides
    order = np.argsort(key, kind="stable")
    key = key[order]
    rows = np.stack(np.meshgrid(*[[-1, 0, 1]] * (x.shape[1] - 1), indexing="ij"), axis=-1).reshape(-1, x.shape[1] - 1)
    for start in range(0, len(one), PART):
        part = one[start : start + PART]
        place = np.clip(np.floor((part - lower) / side), -1, cell.max(axis=0)).astype(np.int64) + 1
        middle = (place @ strides)[:, None] + rows @ strides[1:]
        first, end = np.searchsorted(key, middle - 1), np.searchsorted(key, middle + 1, side="right")
        counts = (end - first).ravel()
        i = np.repeat(np.arange(len(part)), (end - first).sum(axis=1))
        j = order[np.arange(len(i)) + np.repeat(first.ravel() - np.cumsum(counts) + counts, counts)]
        distance2 = ((part[i] - two[j]) ** 2).sum(axis=1)
        near = distance2 < support**2
        yield i[near] + start, j[near], distance2[near]


def mean_neighbours(x: np.ndarray, support: float) -> float:
    """Mean number of other fluid particles within `support` [m] of a particle; `x` [m] is (N, dim). Walls are not counted."""
    n = len(x)
    return (sum(len(i) for i, _, _ in near_pairs(x, support)) - n) / n if n else 0.0


def nearest_pair(x: np.ndarray, limit: float) -> tuple[float, int, int] | None:
    """Return distance [m] and places of the two of `x` [m], (N, dim), that are nearest to each other, if below `limit` [m]."""
    from scipy.spatial import (
        cKDTree,
    )  # not at the top: most runs need no tree, and its import takes longer than NumPy's

    if len(x) < 2:
        return None
    distances, places = cKDTree(x).query(x, k=2, distance_upper_bound=limit)
    i = int(np.argmin(distances[:, 1]))
    if not distances[i, 1] < limit:
        return None
    j = int(places[i][places[i] != i][0])  # particles in one place may come before the particle itself
    return float(distances[i, 1]), min(i, j), max(i, j)


def mean_occupancy(x: np.ndarray, side: float) -> float:
    """Mean number of particles, itself included, in a particle's cell of side `side` [m]: cheaper than counting neighbours."""
    cell = np.floor((x - x.min(axis=0)) / side).astype(np.int64)
    counts = np.unique(cell @ np.cumprod([1, *(cell.max(axis=0) + 1)[:-1]]), return_counts=True)[1]
    return float((counts**2).sum() / len(x))
