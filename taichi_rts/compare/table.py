"""The comparison on screen and in files: one row a run."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from typing import Any

from rich.markup import escape
from rich.table import Table

from taichi_rts.compare.measures import ERRORS, MATCHED
from taichi_rts.compare.sweeps import describe
from taichi_rts.compare.variants import BASE_STEP, LARGEST_STABLE, SWEEP

COLUMNS = (
    "wall_seconds",
    "particle_updates",
    "pair_interactions",
    "base_steps",
    "peak_memory_bytes",
    "active_fraction",
)
SPEEDUPS = ("equal_step", "largest_stable", "equal_error", "equal_error_is_bound", "bound")


SPREAD = 1.3
"""Slowest over fastest repeat of a run above which wall times are called doubtful."""
ROLES = {SWEEP: "", BASE_STEP: " (dt_b)", LARGEST_STABLE: " (stable)"}


def make_tables(report: Mapping[str, Any], number: int) -> list[Table]:
    """Return the tables of one scene: what each run costs, and its errors and speed-ups; neither wider than 80 columns."""
    ground, error = report["scenes"][number], report["judged_by"]
    runs = [run for run in report["variants"] if run["scene"] == number]
    title = " ".join(part for part in (ground["scene"]["name"], describe(ground["changes"])) if part)
    costs = _table(f"{title}, {ground['particles']:,} particles: costs", "wall [s]", "updates", "pairs", "steps", "MiB")
    shown = list(dict.fromkeys([error, "front"]))
    names = (name.replace("_", " ") for name in shown)
    gains = _table(
        f"Errors, and {report['cost']} of uniform steps over a run's", *names, "= step", "stable", "= error", "bound"
    )
    for run in runs:
        name, style = run["label"], "bold" if run["pareto"] else None
        if run["survived"]:
            costs.add_row(name + ROLES[run["role"]], *_costs(run["costs"]), style=style)
            gains.add_row(name, *(_error(run["errors"][key]) for key in shown), *_gains(run["speedups"]), style=style)
        else:
            costs.add_row(name + ROLES[run["role"]], "[red]failed[/]")
            gains.add_row(name, "[red]failed[/]")
    gains.add_section()
    gains.add_row("(reference itself)", *(_error(ground["floor"][name]) for name in shown), style="dim")
    return [costs, gains]


def _table(title: str, *headings: str) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column("run")
    for heading in headings:
        table.add_column(escape(heading), justify="right", no_wrap=True)
    return table


def _costs(costs: Mapping[str, Any]) -> list[str]:
    counts = (_short(costs["particle_updates"]), _short(costs["pair_interactions"]), f"{costs['base_steps']:,}")
    return [f"{costs['wall_seconds']:.3g}", *counts, f"{costs['peak_memory_bytes'] / 2**20:.0f}"]


def _gains(gains: Mapping[str, Any] | None) -> list[str]:
    if gains is None:
        return []
    equal = "-" if gains["equal_error"] is None else _gain(gains["equal_error"])
    star = "*" if gains["equal_error_is_bound"] else ""
    return [_gain(gains["equal_step"]), _gain(gains["largest_stable"]), equal + star, _gain(gains["bound"])]


def notes(report: Mapping[str, Any], number: int) -> list[str]:
    """Return the sentences that the tables of one scene need: what did not survive, until when particles are matched."""
    ground, stable = report["scenes"][number], report["largest_stable"][number]
    failed = [
        f"{run['label']} did not survive: {run['reason']}."
        for run in report["variants"]
        if run["scene"] == number and not run["survived"]
    ]
    if stable["stable"] is None:
        largest = f"No uniform step survives: {stable['reason']}."
    else:
        beyond = (
            f"at {stable['unstable']:.4g}: {stable['reason']}" if stable["unstable"] else "larger ones were not tried"
        )
        largest = f"Largest stable uniform step: λ={stable['stable']:.4g} ({beyond})."
    columns = (
        "Speed-ups over uniform steps: = step, of its base step dt_b (asynchronous: of its longest); stable, of the largest that "
        "survives; = error, of the best at this error (- where none is so accurate); bound, the most that = step could be."
    )
    marked = any((run["speedups"] or {}).get("equal_error_is_bound") for run in report["variants"])
    star = ["* Even the cheapest uniform run is more accurate than this one, and is taken as it is."] if marked else []
    bold = f"Bold: no other run is both cheaper ({report['cost']}) and more accurate ({report['judged_by']})."
    return [bold, columns, *star, *failed, largest, parting_sentence(ground), *_doubts(report, number)]


def _doubts(report: Mapping[str, Any], number: int) -> list[str]:
    """Say how far the reference is below the runs, and whether wall times can be trusted."""
    error, ground = report["judged_by"], report["scenes"][number]
    runs = [run for run in report["variants"] if run["scene"] == number and run["survived"]]
    errors = [run["errors"][error] for run in runs if run["errors"][error]]
    floor, lines = ground["floor"][error], []
    if floor and errors:
        ratio = min(errors) / floor
        close = "; errors up to twice the reference's own say nothing" if ratio < 2.0 else ""
        lines.append(
            f"Reference: uniform λ={ground['reference_courant']:.3g} in double precision, whose own error in {error}, "
            f"{floor:.2g}, is {ratio:.3g} times smaller than the smallest here{close}."
        )
    spreads = [max(each) / min(each) for run in runs if min(each := run["costs"]["wall_seconds_all"]) > 0.0]
    if spreads and max(spreads) > SPREAD:
        lines.append(
            f"Wall times of the same run differ by up to {max(spreads) - 1.0:.0%}: the machine is busy or the runs are short; "
            "repeat it when idle, or judge by --cost updates."
        )
    return lines


def parting_sentence(ground: Mapping[str, Any]) -> str:
    """Say until when particles are compared one by one."""
    names = " and ".join(MATCHED)
    time = ground["parting_time"]
    if not ground["parted"]:
        return f"The references stay together to the end, t_p = {time:.4g} s: {names} are compared over the whole run."
    return (
        f"The two references part after t_p = {time:.4g} s (at the next sample velocities differ by more than "
        f"{ground['parting_threshold']:.3g}): "
        f"{names} are compared up to then, all else over the whole run."
    )


def to_csv(report: Mapping[str, Any]) -> bytes:
    """Return all runs as CSV, one a row; empty where there is no value."""
    header = ["run", "scene", "family", "courant", "options", "changes", "role", "survived", "reason", "pareto"]
    names = [*header, *COLUMNS, *(f"error_{name}" for name in ERRORS), *(f"speedup_{name}" for name in SPEEDUPS)]
    text = io.StringIO()
    writer = csv.DictWriter(text, names, restval="", lineterminator="\n")
    writer.writeheader()
    for run in report["variants"]:
        row = {name: run[name] for name in header[1:] if name not in ("options", "changes", "scene")}
        row |= {"run": run["label"], "scene": report["scenes"][run["scene"]]["scene"]["name"]}
        row |= {"options": describe(run["options"]), "changes": describe(run["changes"])}
        row |= {name: run["costs"].get(name) for name in COLUMNS}
        row |= {f"error_{name}": run["errors"].get(name) for name in ERRORS}
        row |= {f"speedup_{name}": (run["speedups"] or {}).get(name) for name in SPEEDUPS}
        writer.writerow({name: "" if value is None else value for name, value in row.items()})
    return text.getvalue().encode()


def _error(value: float | None) -> str:
    return "-" if value is None else f"{value:.2g}"


def _gain(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _short(count: float) -> str:
    for factor, unit in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if count >= factor:
            return f"{count / factor:.3g}{unit}"
    return f"{count:.0f}"
