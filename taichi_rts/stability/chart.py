"""What the map looks like: a table in the terminal, rows for a spreadsheet, and a heat map."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from typing import Any

from rich.table import Table

from taichi_rts.errors import OutputError
from taichi_rts.stability.cases import Case
from taichi_rts.stability.suite import Cell, Plan, Setting

FAIL = "#d55e00"  # vermilion of Okabe & Ito's palette, safe for colour-blind readers and absent from the map


def make_table(plan: Plan, cells: Sequence[Cell]) -> Table:
    """Return the map as a table: the largest stable courant, or with `quick` whether the default survived."""
    found = {(cell.case, cell.setting): cell for cell in cells}
    title = "survival at the defaults" if plan.quick else "largest stable courant (of the longest step)"
    table = Table(title=title, title_justify="left", caption="\n".join(notes(plan)) or None, caption_justify="left")
    table.add_column("case", no_wrap=True)
    table.add_column("density\nallowed", justify="right", no_wrap=True)
    for setting in plan.settings:
        heading = setting.name.replace("_", "\n")
        table.add_column(f"{heading}\n[dim]{setting.default:.3g}[/]", justify="right", no_wrap=True, vertical="bottom")
    for case in plan.cases:
        row = [found.get((case.name, setting.name)) for setting in plan.settings]
        demanded = next((f"{1.05 * cell.demanded:.3f}" for cell in row if cell), "")
        table.add_row(case.name, demanded, *(mark(cell, plan.quick) for cell in row))
    return table


def notes(plan: Plan) -> list[str]:
    """Return a line for each reason why cells were left out."""
    by_reason: dict[str, list[tuple[str, str]]] = {}
    for names, reason in plan.skipped.items():
        by_reason.setdefault(reason, []).append(names)
    return [
        f"left out: {', '.join(sorted({case for case, _ in names}))} with "
        f"{', '.join(sorted({setting for _, setting in names}))}: {reason}"
        for reason, names in by_reason.items()
    ]


def mark(cell: Cell | None, quick: bool) -> str:
    """Return a cell as text for the terminal; red where the default does not survive."""
    if cell is None:
        return "[dim]-[/]"
    if quick:
        return "ok" if cell.outcome.survived else "[bold red]FAIL[/]"
    text = label(cell).replace("\n", " ")
    return text if cell.outcome.survived else f"[bold red]{text}[/]"


def label(cell: Cell) -> str:
    """Return the largest stable courant and below it that of the longest step, e.g. "0.65" and "(1.30)"."""
    if cell.stable is None:
        return f"<{cell.unstable:.2g}"
    least = "≥" if cell.unstable is None else ""
    longest = f"\n({cell.longest:.2f})" if cell.longest is not None else ""
    return f"{least}{cell.stable:.2f}{longest}"


def failures(cells: Sequence[Cell]) -> list[str]:
    """Return a line for each default that does not survive."""
    return [
        f"{cell.case} with {cell.setting} at {cell.default:.3g}: {cell.outcome.reason}"
        for cell in cells
        if not cell.outcome.survived
    ]


def make_csv(cells: Sequence[Cell]) -> bytes:
    """Return one line a cell, with a heading."""
    text = io.StringIO()
    heading = ["case", "stepper", "default", "survives_at_default", "stable", "unstable", "longest", "density"]
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*heading, "demanded", "energy", "reason_at_default", "reason_at_unstable"])
    for cell in cells:
        seen = cell.outcome
        row = [cell.case, cell.setting, cell.default, seen.survived, cell.stable, cell.unstable, cell.longest]
        writer.writerow([*row, seen.density, cell.demanded, seen.energy, seen.reason, cell.reason])
    return text.getvalue().encode()


def require_matplotlib() -> Any:
    """Return matplotlib; raises `OutputError` where the extra `plots` is not installed."""
    try:
        import matplotlib.cm  # only here, because it is an extra
        import matplotlib.colors
    except ImportError:
        raise OutputError(
            "matplotlib is not installed, and the heat map needs it; pip install 'taichi_rts[plots]', or give --no-plot"
        ) from None
    return matplotlib


def draw_map(plan: Plan, cells: Sequence[Cell]) -> bytes:
    """Draw the heat map as a PNG: colour is the largest stable over the default courant, on a logarithmic scale.

    Numbers are the largest stable courant and that of the longest step; a cell whose default fails has a thick frame and a
    cross. Hatched cells were not run.
    """
    matplotlib = require_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    cases: list[Case] = list(plan.cases)
    settings: Sequence[Setting] = plan.settings
    figure = Figure(figsize=(2.6 + 1.15 * len(settings), 1.6 + 0.44 * len(cases)), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    colours = matplotlib.colormaps["cividis"]
    low, high = -2.0, 2.5  # log2 of stable over default
    found = {(cell.case, cell.setting): cell for cell in cells}
    for i, case in enumerate(cases):
        for j, setting in enumerate(settings):
            cell = found.get((case.name, setting.name))
            if cell is None:
                axes.add_patch(Rectangle((j, i), 1, 1, fill=False, hatch="//", edgecolor="0.8"))
                continue
            margin = math.log2((cell.stable or 0.5 * (cell.unstable or setting.default)) / setting.default)
            shade = min(max((margin - low) / (high - low), 0.0), 1.0)
            axes.add_patch(Rectangle((j, i), 1, 1, facecolor=colours(shade), edgecolor="white"))
            ink = "white" if shade < 0.5 else "black"
            bad = not cell.outcome.survived
            text = ("✗ " if bad else "") + label(cell).replace("\n", " ")
            axes.text(j + 0.5, i + 0.5, text, ha="center", va="center", color=ink, fontsize=8)
            if bad:
                frame = Rectangle((j + 0.04, i + 0.06), 0.92, 0.88, fill=False, edgecolor=FAIL, linewidth=2.5)
                axes.add_patch(frame)
    axes.set_xlim(0, len(settings))
    axes.set_ylim(len(cases), 0)
    names = [f"{setting.name.replace('_', chr(10))}\ndefault {setting.default:.3g}" for setting in settings]
    axes.set_xticks([j + 0.5 for j in range(len(settings))], names, fontsize=8)
    axes.set_yticks([i + 0.5 for i in range(len(cases))], [case.name for case in cases], fontsize=8)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    scale = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(low, high), colours)
    bar = figure.colorbar(scale, ax=axes, shrink=0.7)
    bar.set_label("largest stable over default courant", fontsize=8)
    ticks = list(range(math.ceil(low), math.floor(high) + 1))
    bar.set_ticks(ticks, labels=[f"{2.0**k:g}x" for k in ticks])
    axes.set_title("Largest stable courant (of the longest step); framed: the default fails", fontsize=9)
    out = io.BytesIO()
    figure.set_dpi(150)
    canvas.print_png(out)
    return out.getvalue()
