"""Cost against size (extra `plots`): a line for each thing measured, sizes on a logarithmic axis."""

from __future__ import annotations

import io
from collections.abc import Sequence

from taichi_rts.benchmarks.rows import Row
from taichi_rts.trials.plotting import MARKERS, PALETTE


def draw(rows: Sequence[Row]) -> bytes:
    """Return the plot of `rows` that belong to curves over the number of particles as PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.0), dpi=140, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for k, what in enumerate(dict.fromkeys(row.what for row in rows)):
        points = sorted((row.particles, row.value) for row in rows if row.what == what)
        axes.plot(*zip(*points, strict=True), color=PALETTE[k], marker=MARKERS[k], label=what)
    axes.set_xscale("log")
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("fluid particles")
    axes.set_ylabel("wall time per particle update [ns]")
    axes.grid(alpha=0.3)
    if rows:
        axes.legend(frameon=False)
    data = io.BytesIO()
    figure.savefig(data, format="png")
    return data.getvalue()
