"""What follows from the runs: speed-ups over both baselines, the Pareto front, the verdict."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taichi_rts.compare.measures import MATCHED
from taichi_rts.compare.speedups import EqualError, Point, at_equal_error, cost_at, fastest_at, ladder, pareto_front
from taichi_rts.compare.sweeps import changes_by, describe

COSTS = {"wall": "wall_seconds", "updates": "particle_updates"}
"""What a run can cost, by the name on the command line."""
TIE = 1.05
"""A gain less than this is called none: wall times repeat to a few percent."""
RELIABLE = 2.0
"""An error less than this many times the floor says more about the reference than about the run."""


def analyse(report: dict[str, Any], error: str, cost: str) -> dict[str, Any]:
    """Add to `report` the speed-ups of every run (`speedups`), which are on the Pareto front, and the `verdict`.

    `error` is one of `measures.ERRORS`, `cost` one of `COSTS`.
    """
    report = report | {"judged_by": error, "cost": cost}
    for number in range(len(report["scenes"])):
        here = [run for run in report["variants"] if run["scene"] == number]
        usable = [run for run in here if point(run, error, cost)]
        points = [_point(run, error, cost) for run in usable]
        for run in here:
            run["pareto"] = False
            run["speedups"] = speedups(run, here, report["largest_stable"][number], error, cost)
        for k in pareto_front(points):
            usable[k]["pareto"] = True
    report["verdict"] = [line for number in range(len(report["scenes"])) for line in verdict(report, number)]
    return report


def point(run: dict[str, Any], error: str, cost: str) -> Point | None:
    """Return cost and error of a run; None if it did not survive or has no such error."""
    found = run["errors"].get(error)
    if not run["survived"] or not found:
        return None
    return float(run["costs"][COSTS[cost]]), float(found)


def _point(run: dict[str, Any], error: str, cost: str) -> Point:
    found = point(run, error, cost)
    assert found is not None
    return found


def speedups(
    run: dict[str, Any], runs: Sequence[dict[str, Any]], stable: dict[str, Any], error: str, cost: str
) -> dict[str, Any] | None:
    """Return how many times cheaper a run is than uniform steps, in four ways; None for uniform runs and failed ones.

    `equal_step`: than uniform steps of its base step dt_b (asynchronous: of its longest), the paper's baseline.
    `largest_stable`: than uniform steps at the largest that survives this scene, whatever the errors.
    `equal_error`: than the best of all uniform runs at equal error, along their Pareto front (`speedups.cost_at`).
    `bound`: the most that `equal_step` could be, from the share of due particles and what all pay (method.md).
    """
    if run["family"] == "uniform" or not run["survived"]:
        return None
    own = run["costs"][COSTS[cost]]
    uniform = [each for each in runs if each["family"] == "uniform" and each["survived"]]

    def over(courant: float | None) -> float | None:
        return next(
            (u["costs"][COSTS[cost]] / own for u in uniform if u["courant"] == courant and not u["options"]), None
        )

    place = point(run, error, cost)
    baseline = [found for each in uniform if (found := point(each, error, cost))]
    equal = at_equal_error(baseline, place) if place else EqualError(None)
    bound = run["costs"]["speedup_bound"]
    if bound is not None and run["family"] == "asynchronous":
        bound /= run["stepper"]["levels"]  # the solver's bound is over steps of one tick
    if changes_by(run["family"]):
        bound = None  # its base step is that of a sound speed which hardly any particle has
    return {
        "equal_step": over(run["equal_step"]),
        "largest_stable": over(stable["stable"]),
        "equal_error": equal.speedup,
        "equal_error_is_bound": equal.bound,
        "bound": bound,
    }


def series_points(
    runs: Sequence[dict[str, Any]], error: str, cost: str
) -> dict[str, list[tuple[Point, dict[str, Any]]]]:
    """Return for every series its points and runs, by falling Courant number."""
    found: dict[str, list[tuple[Point, dict[str, Any]]]] = {}
    for run in runs:
        if place := point(run, error, cost):
            found.setdefault(run["series"], []).append((place, run))
    return {name: sorted(items, key=lambda item: -item[1]["courant"]) for name, items in found.items()}


def verdict(report: dict[str, Any], number: int) -> list[str]:
    """Say in plain sentences which is the fastest at each error, and whether steps that vary in space beat the best uniform."""
    error, cost = report["judged_by"], report["cost"]
    ground = report["scenes"][number]
    title = f"{describe(ground['changes'])}: " if ground["changes"] else ""
    runs = [run for run in report["variants"] if run["scene"] == number]
    curves = {name: [place for place, _ in items] for name, items in series_points(runs, error, cost).items()}
    if not curves:
        return [f"{title}no run has an error in {error} to be judged by{_why_none(ground, error)}"]
    errors = [place[1] for points in curves.values() for place in points]
    steps = [(each, fastest_at(curves, each)) for each in ladder(min(errors), max(errors)) or [max(errors)]]
    unit = "s" if cost == "wall" else "updates"
    ranks = "; ".join(f"{each:.2g}: {found[0]} ({_amount(found[1])} {unit})" for each, found in steps if found)
    return [
        f"{title}fastest at each error in {error}: {ranks}",
        title + gain_sentence(runs, error, cost, ground["floor"][error]),
    ]


def gain_sentence(runs: Sequence[dict[str, Any]], error: str, cost: str, floor: float | None) -> str:
    """Say whether a regional or asynchronous run beats the best uniform one at equal error, and by how much."""
    others = [run for run in runs if run["family"] != "uniform" and point(run, error, cost)]
    uniform = [place for run in runs if run["family"] == "uniform" and (place := point(run, error, cost))]
    if not others or not uniform:
        return "no verdict: a uniform and another stepper that both survive are needed"
    found = [(run, *cost_at(uniform, _point(run, error, cost)[1])) for run in others]
    reached = [
        (run, baseline / _point(run, error, cost)[0], bound) for run, baseline, bound in found if baseline is not None
    ]
    sharper = [run for run, baseline, _ in found if baseline is None]
    word = "time" if cost == "wall" else "updates"
    beyond = ""
    if sharper:
        run = min(sharper, key=lambda each: _point(each, error, cost)[1])
        beyond = f" {run['label']} reaches {_point(run, error, cost)[1]:.2g}, which no uniform run here does."
    if not reached:
        return f"No uniform run is as accurate as any of the others.{beyond}"
    run, gain, bound = max(reached, key=lambda item: item[1])
    own = _point(run, error, cost)[1]
    how = "a uniform run that is more accurate still" if bound else "the best uniform"
    doubt = (
        f" Errors below {RELIABLE * floor:.2g} say more about the reference than about the run."
        if floor and min(each[1] for each in [*uniform, *(_point(r, error, cost) for r in others)]) < RELIABLE * floor
        else ""
    )
    if gain > TIE:
        text = f"Yes: at equal error ({own:.2g}) {run['label']} is {gain:.2f} times as cheap as {how}, by {word}."
    elif gain > 1.0 / TIE:
        text = (
            f"No gain: at equal error ({own:.2g}) {run['label']} comes to within {TIE - 1.0:.0%} of {how}, by {word}."
        )
    else:
        text = (
            f"No: at equal error no regional or asynchronous run beats the best uniform; the nearest, {run['label']}, takes "
            f"{1.0 / gain:.2f} times the {word} of {how} ({own:.2g})."
        )
    return text + beyond + doubt


def _why_none(ground: dict[str, Any], error: str) -> str:
    if error in MATCHED and not ground["parting_time"]:
        return "; the references part before the first sample: choose another --error, or a shorter --end-time"
    return ""


def _amount(cost: float) -> str:
    return f"{cost:,.0f}" if cost >= 1000.0 else f"{cost:.3g}"
