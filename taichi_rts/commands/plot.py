"""`taichi-rts plot RUN`: the time series of runs as curves, beside measurements."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from taichi_rts.errors import OutputError, did_you_mean
from taichi_rts.files.writing import write_bytes
from taichi_rts.trials.plotting import PALETTE, require_plots

KINDS = (".png", ".pdf", ".svg")
STYLES = ("-", "--", ":", "-.")
HEADINGS = {
    "energy [J]": ("kinetic_energy", "potential_energy", "internal_energy"),
    "place [m]": ("front", "centre_"),
    "largest speed [m/s]": ("max_speed",),
    "share of particles": ("level_",),
    "updates": ("particle_updates",),
    "mass [kg]": ("inflow", "outlet_"),
    "pressure [Pa]": ("pressure_",),
    "height [m]": ("height_",),
    "force [N]": ("force_",),
}
"""Heading of each diagram, and columns in it; a name that ends in "_" stands for all that begin so."""


@dataclasses.dataclass(frozen=True)
class Curves:
    """Columns over time: of a run, or measured.

    Attributes:
        name: what they are called in the picture.
        time: [s], (N,).
        values: by column, (N,) each; NaN where nothing is known.
    """

    name: str
    time: np.ndarray
    values: dict[str, np.ndarray]

    @classmethod
    def of(cls, path: Path, name: str) -> Curves:
        """Read a CSV file with a column `time`; raises `OutputError` for what is none, with the line."""
        try:
            with path.open(newline="", encoding="utf-8-sig") as file:
                lines = csv.reader(file, skipinitialspace=True)
                heads = [head.strip() for head in next(lines, [])]
                rows = [[_number(cell, path, n) for cell in row] for n, row in enumerate(lines, start=2) if row]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise OutputError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
        if "time" not in heads:
            raise OutputError(f"{path} has no column 'time' [s]; its first line names {', '.join(heads) or 'nothing'}")
        short = next((n for n, row in enumerate(rows, start=2) if len(row) != len(heads)), None)
        if short is not None:
            raise OutputError(f"{path}, line {short}: {len(rows[short - 2])} values for {len(heads)} columns")
        if not rows:
            raise OutputError(f"{path} has no rows; a run writes one for each frame")
        columns = dict(zip(heads, np.array(rows).T, strict=True))
        return cls(name, columns.pop("time"), columns)


@dataclasses.dataclass(frozen=True)
class Plot:
    """Draw the time series of runs as curves: energies, levels, probes, gauges, forces. Needs the extra `plots`.

    The runs may be finished or under way. Several are drawn into the same diagrams.
    """

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(help_behavior_hint="")]
    """Output folders of runs."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """File of the picture, .png, .pdf or .svg; by default series.png in the first run's folder."""
    against: Path | None = None
    """Measurements, drawn as dots: a CSV file with a column time [s] and others named as in series.csv."""
    columns: tuple[str, ...] = ()
    """Only these columns of series.csv; "force" stands for all whose name begins so."""
    overwrite: bool = False
    """Replace the picture if it is there already."""

    def __call__(self) -> None:
        """Draw them."""
        require_plots("read series.csv with another program")
        if not self.runs:
            raise OutputError("no run to draw; name its output folder, such as out/dam_break")
        path = self.output or self.runs[0] / "series.png"
        if path.suffix not in KINDS:
            raise OutputError(f"{path} has no known ending; use one of {', '.join(KINDS)}")
        runs = [curves for folder in self.runs for curves in series_of(folder, several=len(self.runs) > 1)]
        measured = Curves.of(self.against, "measured") if self.against is not None else None
        diagrams = diagrams_of(runs, self.columns, measured)
        if path.exists() and not self.overwrite:
            raise OutputError(f"{path} is there already; give --overwrite to replace it, or another --output")
        write_bytes(path, draw(diagrams, runs, measured, path.suffix[1:]))
        print(f"{sum(map(len, diagrams.values()))} curves of {len(runs)} time series in {path}")


def series_of(folder: Path, *, several: bool) -> list[Curves]:
    """Return the time series in an output folder; raises `OutputError` if it has none."""
    paths = sorted(folder.glob("series*.csv"), key=lambda path: (len(path.name), path.name))
    if not paths:
        raise OutputError(f"{folder} holds no series.csv; give the output folder of a run")
    place = folder.resolve().name
    return [
        Curves.of(path, f"{place}, {path.stem}" if several and len(paths) > 1 else place if several else path.stem)
        for path in paths
    ]


def diagrams_of(
    runs: Sequence[Curves], wanted: Sequence[str] = (), measured: Curves | None = None
) -> dict[str, list[str]]:
    """Return the columns of each diagram: all, or those `wanted`; else, beside measurements, those that were measured.

    Raises `OutputError` for columns that no run has.
    """
    known = list(dict.fromkeys(name for run in runs for name in run.values))
    if measured is not None and not (set(measured.values) & set(known)):
        raise OutputError(
            f"no column of the measurements ({', '.join(measured.values) or 'none'}) is one of the run's: {', '.join(known)}"
        )
    for name in wanted:
        if not _those(known, [name, f"{name}_"]):
            hint = did_you_mean(name, known)
            raise OutputError(f"no run has a column {name!r}{hint} (there are {', '.join(known)})")
    chosen = known
    if wanted:
        chosen = _those(known, [part for name in wanted for part in (name, f"{name}_")])
    elif measured is not None:
        chosen = [name for name in known if name in measured.values]
    found = {heading: _those(chosen, names) for heading, names in HEADINGS.items()}
    return {heading: names for heading, names in found.items() if names}


def draw(
    diagrams: Mapping[str, Sequence[str]], runs: Sequence[Curves], measured: Curves | None = None, kind: str = "png"
) -> bytes:
    """Return the diagrams as a picture of a `kind`: colours tell columns apart, lines runs, dots are measured."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # only here, because it is an extra
    from matplotlib.figure import Figure

    across = 1 if len(diagrams) == 1 else 2
    down = math.ceil(len(diagrams) / across)
    figure = Figure(figsize=(6.4 * across, 3.4 * down), layout="constrained")
    FigureCanvasAgg(figure)
    for place, (heading, names) in enumerate(diagrams.items(), start=1):
        axes: Any = figure.add_subplot(down, across, place)
        for k, name in enumerate(names):
            colour = PALETTE[k % len(PALETTE)]
            for n, run in enumerate(runs):
                if name in run.values:
                    label = name if len(runs) == 1 else f"{name}, {run.name}"
                    axes.plot(run.time, run.values[name], STYLES[n % len(STYLES)], color=colour, label=label)
            if measured is not None and name in measured.values:
                label = f"{name}, {measured.name}"
                axes.plot(measured.time, measured.values[name], ".", color=colour, markersize=4, label=label)
        axes.set(xlabel="time [s]", ylabel=heading)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7, framealpha=0.7)
    file = io.BytesIO()
    figure.savefig(file, format=kind, dpi=120)
    return file.getvalue()


def _those(columns: Iterable[str], names: Sequence[str]) -> list[str]:
    """The columns that are one of the names, or begin with one that ends in "_"."""
    return [
        column
        for column in columns
        if any(column == name or (name.endswith("_") and column.startswith(name)) for name in names)
    ]


def _number(cell: str, path: Path, line: int) -> float:
    """The number in a cell, NaN in an empty one."""
    try:
        return float(cell) if cell.strip() else math.nan
    except ValueError:
        raise OutputError(f"{path}, line {line}: {cell!r} is no number") from None
