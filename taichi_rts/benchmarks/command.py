"""`taichi-rts bench`: the table of speed."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.table import Table

from taichi_rts.benchmarks import peers
from taichi_rts.benchmarks.device import device
from taichi_rts.benchmarks.plot import draw
from taichi_rts.benchmarks.rows import ROWS, Row, Settings, profile
from taichi_rts.device import forks
from taichi_rts.errors import Error
from taichi_rts.files.writing import write_bytes, write_json
from taichi_rts.trials.plotting import require_plots

PARTS = {**ROWS, "device": device}


@dataclass(frozen=True)
class Bench:
    """Measure how fast the solver is, beside SPlisHSPlasH where it is installed, and print the table.

    On an otherwise idle machine it takes about half an hour; `--rows` chooses parts, `--scale 0.05` tries them out.
    """

    rows: tuple[str, ...] = tuple(ROWS)
    """Parts of the table: any of peer, second, regional, one_level, sparse, size, memory, papers_sizes, first_frame;
    device is for a GPU."""
    arch: Literal["cpu", "cuda", "vulkan"] = "cpu"
    """Where kernels run."""
    json: Path | None = None
    """Also write the figures to this file."""
    plot: Path | None = None
    """Also draw cost against size (rows size) into this PNG file; needs the extra `plots`."""
    profile: bool = False
    """Instead print the time of each kernel."""
    peer_script: Path = peers.SCRIPT
    """Script that runs SPlisHSPlasH's side and prints a line of JSON."""
    scale: float = 1.0
    """Numbers of particles over those of the table."""
    repeats: int = 5
    """Timed windows a figure; the median counts."""

    def __call__(self) -> None:
        """Measure, print and write."""
        if unknown := sorted(set(self.rows) - set(PARTS)):
            raise Error(f"--rows {', '.join(unknown)}: no such part of the table; choose any of {', '.join(PARTS)}")
        if not 0.0 < self.scale <= 4.0:
            raise Error(f"--scale {self.scale:g}: must be above 0 and at most 4; 1 is the table's own size")
        if not 1 <= self.repeats <= 100:
            raise Error(f"--repeats {self.repeats}: must be 1 to 100; 5 is usual")
        if self.plot is not None:
            require_plots("leave out --plot")
        settings = Settings(self.arch, self.peer_script, self.scale, self.repeats)
        console = Console()
        parts = [profile] if self.profile else [PARTS[name] for name in self.rows]
        found: list[Row] = []
        for part in parts:
            for row in part(settings):
                found.append(row)
                console.print(
                    f"{row.what} | {row.size} | {row.value:.4g} {row.unit} | {row.bar} | {row.note}", soft_wrap=True
                )
        console.print(table(found))
        if self.json is not None:
            data = {
                "machine": platform.processor() or platform.machine(),
                "threads": settings.threads,
                "arch": self.arch,
                **forks.versions(),
                "rows": [row.as_dict() for row in found],
            }
            write_json(self.json, data)
        if self.plot is not None:
            write_bytes(self.plot, draw([row for row in found if row.particles]))


def table(rows: list[Row]) -> Table:
    """Return the rows as a table for the screen."""
    result = Table("what", "particles", "value", "bar", "met", title="Speed")
    for row in rows:
        result.add_row(row.what, row.size, f"{row.value:.4g} {row.unit}", row.bar, verdict(row))
    return result


def verdict(row: Row) -> str:
    """Say whether a target is met."""
    if not row.bar:
        return ""
    sign, limit = row.bar.split()
    return "yes" if (row.value >= float(limit) if sign == ">=" else row.value <= float(limit)) else "no"
