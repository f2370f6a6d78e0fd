"""From points (cost, error) to speed-ups, a Pareto front and the fastest at each error: pure functions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

Point = tuple[float, float]
"""Cost and error, both above zero."""


@dataclass(frozen=True)
class EqualError:
    """Speed-up over the best of a baseline's points at equal error.

    `speedup` is None where the baseline never becomes that accurate. `bound` tells that even the baseline's cheapest point is
    more accurate than asked, so that it is taken as it is and the speed-up holds for a smaller error than that asked for.
    """

    speedup: float | None
    bound: bool = False

    def __str__(self) -> str:
        """Return it as the table shows it."""
        return "not reached" if self.speedup is None else f"{self.speedup:.2f}{'*' if self.bound else ''}"


def pareto_front(points: Sequence[Point]) -> list[int]:
    """Indices of the points that no other beats in both cost and error, by rising cost."""
    best, front = math.inf, []
    for k in sorted(range(len(points)), key=lambda k: points[k]):
        if points[k][1] < best:
            best = points[k][1]
            front.append(k)
    return front


def cost_at(points: Sequence[Point], error: float) -> tuple[float | None, bool]:
    """Least cost at which points reach `error`: along their Pareto front, linear in the logarithms of cost and error.

    Returns None beyond their smallest error. Above their largest error the cheapest point's cost, and True.
    """
    front = [points[k] for k in pareto_front(points)]
    if not front or error < front[-1][1] * (1.0 - 1e-12):
        return None, False
    if error > front[0][1] * (1.0 + 1e-12):
        return front[0][0], True
    for (cheap, large), (dear, small) in itertools.pairwise(front):
        if small <= error <= large:
            share = math.log(large / error) / math.log(large / small)
            return cheap * (dear / cheap) ** share, False
    return (front[-1][0] if error <= front[-1][1] else front[0][0]), False


def at_equal_error(baseline: Sequence[Point], point: Point) -> EqualError:
    """How many times cheaper `point` is than the `baseline` at the same error."""
    cost, bound = cost_at(baseline, point[1])
    return EqualError(None if cost is None else cost / point[0], bound)


def ladder(low: float, high: float) -> list[float]:
    """Return the errors 10^(k/3) from `low` to `high`, largest first."""
    first, last = math.ceil(3.0 * math.log10(low) - 1e-9), math.floor(3.0 * math.log10(high) + 1e-9)
    return [10.0 ** (k / 3.0) for k in range(last, first - 1, -1)]


def fastest_at(curves: Mapping[str, Sequence[Point]], error: float) -> tuple[str, float] | None:
    """Name and cost of the curve that reaches `error` at the least cost; None if none does."""
    costs = {name: cost for name, points in curves.items() if (cost := cost_at(points, error)[0]) is not None}
    if not costs:
        return None
    name = min(costs, key=lambda key: costs[key])
    return name, costs[name]
