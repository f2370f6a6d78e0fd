"""Wall particles just below the surface of a solid, evenly spaced."""

from __future__ import annotations

import functools

import numpy as np

from taichi_rts.scene.obstacles.solid import Solid

FINE = {2: 24, 3: 6}
"""Points of the surface per spacing, from which the wall particles are chosen, by dimension."""
CLOSEST = {2: 0.75, 3: 0.83}
"""Least distance over the spacing when they are chosen at random, so that one stands for s^(dim-1) on average: in one
dimension they cover 0.7476 of a line (Renyi 1958), in two their number is 0.70 per squared distance (measured)."""
SWEEPS = {2: 60, 3: 15}  # of Lloyd's relaxation
BLUNT = 0.3
"""Least depth of a wall particle over the deepest: none lies on a sharp edge, where it would keep fluid away."""
RANGE = 2.2
"""How far [spacings] neighbours count in a particle's share of the surface."""


def line_solid(solid: Solid, depth: float, spacing: float, least: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] and outward normals, (M, dim) both, of one layer of wall particles `depth` [m] below the surface of a solid.

    By the shape's own formula, if it has one. Else they are points of the surface, sunk until they reach the depth or meet
    those from the other side (a sharp edge, a thin plate), of which some are chosen at random, the deepest first, and evened
    out (Lloyd 1982). Those that do not reach the depth `least` [m], if it is given, are left out; perhaps none is left.
    """
    if solid.even is not None:
        x = solid.even(depth, spacing)
        if least > 0.0:
            x = x[solid.distance(x) <= -least]
        return x, solid.normals(x, 0.1 * spacing)
    fine = spacing / FINE[len(solid.lower)]
    points = solid.surface(fine)
    normals = solid.normals(points, 0.1 * spacing)
    sunk = _sink(solid, points, normals, depth, spacing)
    points = points - sunk[:, None] * normals
    deep = sunk >= max(BLUNT * sunk.max(), least)
    if not deep.any():
        return points[:0], normals[:0]
    some = _thin(points, sunk, fine, deep)
    points, normals, sunk = points[some], normals[some], sunk[some]
    chosen = _relax(points, _choose(points, sunk, spacing), SWEEPS[points.shape[1]])
    return points[chosen], normals[chosen]


def shares(x: np.ndarray, spacing: float) -> np.ndarray:
    """Area that each wall particle stands for, over that of one in a square lattice, (M,): where they crowd it is less.

    One over the sum of (1 - (d/2.2s)^2)^2 over the particles at distances d, normalised by a lattice's. It plays the part of
    the number density in the volumes of Akinci et al. 2012, Eq. 4, with a range that responds to spacing in proportion.
    """
    reach = RANGE * spacing

    def weigh(d2: np.ndarray) -> np.ndarray:
        return np.maximum(1.0 - d2 / reach**2, 0.0) ** 2

    steps = spacing * np.arange(-2, 3)
    whole = weigh(sum(axis**2 for axis in np.meshgrid(*[steps] * (x.shape[1] - 1)))).sum()
    found = np.empty(len(x))
    for k, near in enumerate(neighbours(x, x, reach)):
        found[k] = weigh(((x[near] - x[k]) ** 2).sum(axis=1)).sum()
    return whole / found


def neighbours(x: np.ndarray, probes: np.ndarray, reach: float) -> list[np.ndarray]:
    """Indices of the points `x`, (N, dim), within `reach` [m], or a little more, of each of `probes`, (M, dim)."""
    cells: dict[tuple[int, ...], list[int]] = {}
    for k, place in enumerate(map(tuple, np.floor(x / reach).astype(int).tolist())):
        cells.setdefault(place, []).append(k)
    offsets = list(np.ndindex(*[3] * x.shape[1]))

    @functools.cache
    def around(place: tuple[int, ...]) -> np.ndarray:
        beside = (tuple(p + o - 1 for p, o in zip(place, offset, strict=True)) for offset in offsets)
        return np.array([k for cell in beside for k in cells.get(cell, ())], int)

    return [around(tuple(place)) for place in np.floor(probes / reach).astype(int).tolist()]


def _sink(solid: Solid, x: np.ndarray, normals: np.ndarray, depth: float, spacing: float) -> np.ndarray:
    """How far [m], (N,), points of the surface can go inwards, up to `depth`, before another side is nearer."""
    sunk = np.zeros(len(x))
    sinking = np.ones(len(x), bool)
    for t in depth * np.arange(1, 9) / 8.0:
        y = x[sinking] - t * normals[sinking]
        fine = solid.distance(y) < -t + 0.12 * spacing
        sinking[np.flatnonzero(sinking)[~fine]] = False
        sunk[sinking] = t
    return sunk


def _thin(x: np.ndarray, sunk: np.ndarray, size: float, among: np.ndarray) -> np.ndarray:
    """Indices of the deepest point in each cube of side `size` [m], among those that `among`, (N,), flags."""
    order = np.argsort(-sunk, kind="stable")
    order = order[among[order]]
    _, first = np.unique(np.floor(x[order] / size).astype(int), axis=0, return_index=True)
    return order[np.sort(first)]


def _choose(x: np.ndarray, sunk: np.ndarray, spacing: float) -> np.ndarray:
    """Indices of points of a least distance until no more fit, at random but the deepest first (Poisson discs)."""
    least = CLOSEST[x.shape[1]] * spacing
    rank = np.random.default_rng(0).permutation(len(x))
    near = neighbours(x, x, least)
    free = np.ones(len(x), bool)
    chosen = []
    for k in np.lexsort((rank, -np.round(sunk / spacing, 1))):
        if free[k]:
            chosen.append(k)
            beside = near[k]
            free[beside[((x[beside] - x[k]) ** 2).sum(axis=1) < least**2]] = False
    return np.array(chosen)


def _relax(x: np.ndarray, chosen: np.ndarray, sweeps: int) -> np.ndarray:
    """Exchange every chosen point, an index of `x`, for the one in the middle of those nearest to it, again and again."""
    for _ in range(sweeps):
        owner = _nearest(x[chosen], x)
        counts = np.maximum(np.bincount(owner, minlength=len(chosen)), 1)[:, None]
        sums = np.stack([np.bincount(owner, weights=column, minlength=len(chosen)) for column in x.T], axis=1)
        chosen = _nearest(x, sums / counts)
    return chosen


def _nearest(points: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Index of the nearest of `points`, (M, dim), to each of `x`, (N, dim)."""
    if x.shape[1] == 2:  # curves have few points: less work than the import
        few = np.array_split(x, len(x) * len(points) // 1_000_000 + 1)
        return np.concatenate([((part[:, None] - points) ** 2).sum(axis=2).argmin(axis=1) for part in few])
    from scipy.spatial import cKDTree

    return cKDTree(points).query(x)[1]
