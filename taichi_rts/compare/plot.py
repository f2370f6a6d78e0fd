"""The work-precision plot (extra `plots`): error against cost, log-log, a line for each stepper."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

from taichi_rts.compare.analysis import point, series_points
from taichi_rts.compare.sweeps import describe
from taichi_rts.trials.plotting import MARKERS, PALETTE

AXES = {"wall": "wall time of the solver [s]", "updates": "particle updates"}


def draw(report: Mapping[str, Any]) -> bytes:
    """Return the plot of a report as PNG: one panel for each scene."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    count = len(report["scenes"])
    figure = Figure(figsize=(8.5, 5.6 * count), dpi=140, layout="constrained")
    FigureCanvasAgg(figure)
    series = list(dict.fromkeys(run["series"] for run in report["variants"]))
    for number in range(count):
        axes = figure.add_subplot(count, 1, number + 1)
        _panel(axes, report, number, series)
    data = io.BytesIO()
    figure.savefig(data, format="png")
    return data.getvalue()


def _panel(axes: Any, report: Mapping[str, Any], number: int, series: Sequence[str]) -> None:
    from matplotlib.ticker import LogFormatter

    error, cost = report["judged_by"], report["cost"]
    ground = report["scenes"][number]
    runs = [run for run in report["variants"] if run["scene"] == number]
    places: list[tuple[float, float]] = []
    labels = []
    for name, items in series_points(runs, error, cost).items():
        k = series.index(name)
        colour, marker = PALETTE[k % len(PALETTE)], MARKERS[k % len(MARKERS)]
        x, y = zip(*(place for place, _ in items), strict=True)
        style = "-" if k < len(PALETTE) else "--"
        axes.plot(x, y, style, color=colour, marker=marker, markersize=6, linewidth=1.6, label=name, zorder=3)
        labels += [(place, f"{run['courant']:.3g}", colour) for place, run in items]
        places += zip(x, y, strict=True)
    if not places:
        axes.text(0.5, 0.5, f"no run has an error in {error}", ha="center", transform=axes.transAxes)
        return
    front = sorted(found for run in runs if run["pareto"] and (found := point(run, error, cost)))
    axes.plot(
        *zip(*front, strict=True),
        color="#999999",
        linewidth=7,
        alpha=0.35,
        zorder=1,
        label="Pareto front",
        solid_capstyle="round",
    )
    axes.set_xscale("log")
    axes.set_yscale("log")
    xs, ys = [place[0] for place in places], [place[1] for place in places]
    floor = ground["floor"][error]
    low = min(ys)
    if floor:
        axes.axhspan(floor / 1e3, floor, color="#BBBBBB", alpha=0.4, zorder=0, linewidth=0)
        axes.axhline(floor, color="#666666", linewidth=1, linestyle=":", zorder=1)
        visible = floor > low / 1e3
        if visible:
            axes.annotate(
                "error of the reference", (0.995, floor), xycoords=("axes fraction", "data"), xytext=(0, 3),
                textcoords="offset points", ha="right", va="bottom", fontsize=8, color="#444444",
            )  # fmt: skip
            low = min(low, floor)
    axes.set_xlim(min(xs) / 1.25, max(xs) * 1.35)
    axes.set_ylim(low / 1.6, max(ys) * 1.8)
    axes.grid(which="major", color="#DDDDDD", linewidth=0.8)
    axes.grid(which="minor", color="#EEEEEE", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.set_xlabel(AXES[cost])
    if cost == "wall":
        for ticks in (axes.xaxis.set_major_formatter, axes.xaxis.set_minor_formatter):
            ticks(LogFormatter(labelOnlyBase=False, minor_thresholds=(2, 0.5)))
    until = f", rms to t = {ground['parting_time']:.3g} s" if error in ("velocities", "positions") else ""
    axes.set_ylabel(f"error in {error.replace('_', ' ')}{until}")
    title = " ".join(part for part in (ground["scene"]["name"], describe(ground["changes"])) if part)
    failed = [run["label"] for run in runs if not run["survived"]]
    lost = f"\ndid not survive: {', '.join(failed)}" if failed else ""
    axes.set_title(
        f"{title}, {ground['particles']:,} particles; numbers are Courant numbers λ{lost}", fontsize=10, loc="left"
    )
    axes.legend(fontsize=9, framealpha=0.9)
    _place_labels(axes, labels)


def _place_labels(axes: Any, labels: Sequence[tuple[tuple[float, float], str, str]]) -> None:
    """Write each label beside its point, on the first side where it covers neither a point nor another label."""
    figure = axes.figure
    figure.draw_without_rendering()
    points = [axes.transData.transform(place) for place, _, _ in labels]
    scale = figure.dpi / 72.0
    taken: list[tuple[float, float, float, float]] = [
        (x - 4 * scale, y - 4 * scale, x + 4 * scale, y + 4 * scale) for x, y in points
    ]
    legend = axes.get_legend()
    if legend is not None:
        box = legend.get_window_extent()
        taken.append((box.x0, box.y0, box.x1, box.y1))
    for (place, text, colour), (x, y) in zip(labels, points, strict=True):
        width, height = 5.2 * len(text) * scale, 9.0 * scale
        left, middle = -6 - width / scale, -0.5 * width / scale
        sides = [
            (6, 4),
            (6, -13),
            (left, 4),
            (left, -13),
            (middle, 8),
            (middle, -17),
            (6, 14),
            (6, -23),
            (left, 14),
            (left, -23),
        ]
        boxes = [(x + dx * scale, y + dy * scale, x + dx * scale + width, y + dy * scale + height) for dx, dy in sides]
        best = min(range(len(sides)), key=lambda k: (sum(_overlap(boxes[k], other) for other in taken), k))
        taken.append(boxes[best])
        axes.annotate(text, place, xytext=sides[best], textcoords="offset points", fontsize=8, color=colour, zorder=5)


def _overlap(one: tuple[float, float, float, float], two: tuple[float, float, float, float]) -> float:
    wide = min(one[2], two[2]) - max(one[0], two[0])
    high = min(one[3], two[3]) - max(one[1], two[1])
    return max(wide, 0.0) * max(high, 0.0)
