"""Pairs of particles near each other: how many a particle has, and whether any are too near."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

PART = 20_000
"""Particles whose pairs are found at a time, to save memory: one has some 100 pairs in three dimensions."""


def near_pairs(
    x: np.ndarray, support: float, others: np.ndarray | None = None
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield places i in `x`, j in `others`, and squared distances [m^2], (P,) each, of the pairs nearer than `support` [m].

    Positions `x` and `others` [m] are (N, dim) and (M, dim); without `others` pairs are within `x`: each then comes twice, and
    every particle once with itself. Images across periodic faces are not looked at.
    """
    # Not at the top: most runs need no pairs, and its import takes longer than NumPy's.
    from scipy.spatial import cKDTree

    one = x.astype(np.float64)
    two = one if others is None else others.astype(np.float64)
    if not len(one) or not len(two):
        return
    tree = cKDTree(two)
    for start in range(0, len(one), PART):
        # A little more than the support, and then those that are nearer by the same arithmetic as everywhere.
        part = cKDTree(one[start : start + PART]).sparse_distance_matrix(
            tree, 1.000001 * support, output_type="ndarray"
        )
        i, j = part["i"] + start, part["j"]
        distance2 = ((one[i] - two[j]) ** 2).sum(axis=1)
        near = distance2 < support**2
        yield i[near], j[near], distance2[near]


def mean_neighbours(x: np.ndarray, support: float) -> float:
    """Mean number of other fluid particles within `support` [m] of a particle; `x` [m] is (N, dim). Walls are not counted."""
    n = len(x)
    return (sum(len(i) for i, _, _ in near_pairs(x, support)) - n) / n if n else 0.0


def nearest_pair(x: np.ndarray, limit: float) -> tuple[float, int, int] | None:
    """Return distance [m] and places of the two of `x` [m], (N, dim), that are nearest to each other, if below `limit` [m]."""
    from scipy.spatial import cKDTree  # as above

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
