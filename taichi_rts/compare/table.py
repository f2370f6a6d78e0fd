"""The comparison on screen and in files: one row a run."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from typing import Any

from rich.table import Table

from taichi_rts.compare.measures import ERRORS, MATCHED, PARTED
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


ROLES = {SWEEP: "", BASE_STEP: " (dt_b)", LARGEST_STABLE: " (stable)"}


def make_tables(report: Mapping[str, Any], number: int) -> list[Table]:
    """Return the tables of one scene: costs and errors of every run, and the speed-ups of those that are not uniform."""
    ground, error = report["scenes"][number], report["judged_by"]
    runs = [run for run in report["variants"] if run["scene"] == number]
    title = " ".join(part for part in (ground["scene"]["name"], describe(ground["changes"])) if part)
    shown = list(dict.fromkeys([error, "front"]))
    table = Table(title=f"{title}: {ground['particles']:,} particles", title_justify="left")
    table.add_column("run", no_wrap=True)
    for heading in ("wall [s]", "updates", "pairs", "steps", "MiB", *(name.replace("_", " ") for name in shown)):
        table.add_column(heading, justify="right")
    for run in runs:
        table.add_row(*_row(run, shown), style="bold" if run["pareto"] else None)
    table.add_section()
    table.add_row("reference's own error", *[""] * 5, *(_error(ground["floor"][name]) for name in shown), style="dim")

    gains = Table(title=f"{report['cost']} of uniform steps over that of the run", title_justify="left")
    gains.add_column("run", no_wrap=True)
    for heading in ("at equal step", "at largest stable step", "at equal error", "bound at equal step"):
        gains.add_column(heading, justify="right")
    for run in runs:
        if run["speedups"] is not None:
            gains.add_row(run["label"], *_gains(run["speedups"]))
    return [table, gains] if gains.row_count else [table]


def _row(run: Mapping[str, Any], shown: list[str]) -> list[str]:
    name = f"{run['label']}{ROLES[run['role']]}"
    if not run["survived"]:
        return [name, "[red]failed[/]"]
    costs = run["costs"]
    return [
        name,
        f"{costs['wall_seconds']:.3g}",
        _short(costs["particle_updates"]),
        _short(costs["pair_interactions"]),
        f"{costs['base_steps']:,}",
        f"{costs['peak_memory_bytes'] / 2**20:.0f}",
        *(_error(run["errors"][name]) for name in shown),
    ]


def _gains(gains: Mapping[str, Any]) -> list[str]:
    equal = "not reached" if gains["equal_error"] is None else _gain(gains["equal_error"])
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
    marked = any((run["speedups"] or {}).get("equal_error_is_bound") for run in report["variants"])
    star = ["* Even the cheapest uniform run is more accurate than this one, and is taken as it is."] if marked else []
    bold = f"Bold: no other run is both cheaper ({report['cost']}) and more accurate ({report['judged_by']})."
    return [bold, *star, *failed, largest, parting_sentence(ground)]


def parting_sentence(ground: Mapping[str, Any]) -> str:
    """Say until when particles are compared one by one."""
    names = " and ".join(MATCHED)
    time = ground["parting_time"]
    if not ground["parted"]:
        return f"The references stay together to the end, t_p = {time:.4g} s: {names} are compared over the whole run."
    return (
        f"The two references part after t_p = {time:.4g} s (velocities differ by more than {PARTED:.0%} at the next sample): "
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
            return f"{count / factor:.3g} {unit}"
    return f"{count:.0f}"
