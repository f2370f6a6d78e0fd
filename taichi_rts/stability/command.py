"""`taichi-rts stability`: the map of which case each stepper survives, and up to which step."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, TypeVar

import tyro
from rich.console import Console

from taichi_rts.errors import OutputError, did_you_mean
from taichi_rts.files.writing import remove, require_folder, write_bytes, write_json
from taichi_rts.solver.stepping.steppers import setups
from taichi_rts.stability import chart
from taichi_rts.stability.cases import CASES
from taichi_rts.stability.suite import SETTINGS, Cell, Plan, run_plan
from taichi_rts.terminal import Progress, console

T = TypeVar("T")
FORMER = {former: name for name, (_, setup) in setups("mapped").items() for former in setup.former}
"""Names of settings by those that they had before."""
ARTEFACTS = ("stability.json", "stability.csv", "stability.png", "cells")  # what it writes, and all --overwrite removes


@dataclasses.dataclass(frozen=True)
class Machine:
    """Where and how cases are run."""

    workers: int = 1
    """How many processes to use; each does whole cases."""
    arch: Literal["auto", "cuda", "vulkan", "cpu"] = "cpu"
    """Where kernels run. The cases are so small that a CPU is the fastest."""
    precision: Literal["f32", "f64"] = "f32"
    """Floating-point precision."""


@dataclasses.dataclass(frozen=True)
class Files:
    """What is written, and where."""

    resume: bool = False
    """Keep the cells that an earlier call with the same options stored in the output folder."""
    overwrite: bool = False
    """Replace an earlier map in the output folder."""
    plot: bool = True
    """Draw the heat map (needs the extra `plots`)."""
    output_dir: Path = Path("out") / "stability"
    """Folder for the results."""


@dataclasses.dataclass(frozen=True)
class Stability:
    """Run hard cases with every stepper, and find the largest courant that each survives.

    Writes OUTPUT_DIR/stability.json, .csv and .png, and a file for each cell as soon as it is done, so that --resume goes on
    after a stop. Exit codes: 0 done, 1 with --quick when a default does not survive, 2 wrong input.
    """

    cases: tuple[str, ...] = ()
    """Names of cases; by default all."""
    steppers: tuple[str, ...] = ()
    """Names of steppers, as `taichi-rts compare` has them; by default all."""
    tolerance: float = 0.05
    """How close the largest stable and the smallest unstable courant have to be, relative to each other."""
    quick: bool = False
    """Only say whether each stepper survives at its default courant."""
    machine: tyro.conf.OmitArgPrefixes[Machine] = dataclasses.field(default_factory=Machine)
    files: tyro.conf.OmitArgPrefixes[Files] = dataclasses.field(default_factory=Files)

    def __call__(self) -> None:
        """Run it."""
        if not 0.001 <= self.tolerance <= 1.0:
            raise OutputError(f"tolerance {self.tolerance:g} is not between 0.001 and 1; try 0.05")
        cases = choose("case", self.cases, CASES)
        settings = choose("stepper", [FORMER.get(name, name) for name in self.steppers], SETTINGS)
        plan = Plan(cases, settings, self.tolerance, self.quick, self.machine.arch, self.machine.precision)
        if self.machine.workers < 1:
            raise OutputError(
                f"workers {self.machine.workers} is below 1; use 1, or as many as there are idle processors"
            )
        draws = self.files.plot and not self.quick
        if draws:
            chart.require_matplotlib()
        prepare_folder(self.files.output_dir, self.files.resume, self.files.overwrite)
        plan.fresh()  # so that a missing arch is said before anything else
        cells: list[Cell] = []
        try:
            self.run(plan, cells)
        finally:
            if cells:
                self.write(plan, cells, draws)
        if self.quick and chart.failures(cells):
            raise SystemExit(1)

    def run(self, plan: Plan, cells: list[Cell]) -> None:
        """Run all cells under a progress bar and append them to `cells` as they are done."""
        with Progress("stability", len(plan.cells)) as progress:
            for cell in run_plan(plan, self.files.output_dir, progress.begin, self.machine.workers):
                cells.append(cell)
                progress.advance(1)

    def write(self, plan: Plan, cells: Sequence[Cell], draws: bool) -> None:
        """Print the map and write it, as far as it is done."""
        order = {(case.name, setting.name): place for place, (case, setting) in enumerate(plan.cells)}
        cells = sorted(cells, key=lambda cell: order[cell.case, cell.setting])
        width = max(
            console.width, 40 + 14 * len(plan.settings)
        )  # a narrow terminal had better wrap lines than cut numbers
        Console(width=width).print(chart.make_table(plan, cells))
        for line in chart.failures(cells):
            console.print(f"[bold red]default fails[/] {line}", soft_wrap=True)
        facts: dict[str, Any] = {key: getattr(plan, key) for key in ("tolerance", "quick", "arch", "precision")}
        write_json(
            self.files.output_dir / "stability.json",
            facts
            | {"complete": len(cells) == len(plan.cells), "left_out": chart.notes(plan)}
            | {"cases": {case.name: case.what for case in plan.cases}, "cells": [cell.plain() for cell in cells]},
        )
        write_bytes(self.files.output_dir / "stability.csv", chart.make_csv(cells))
        if draws:
            write_bytes(self.files.output_dir / "stability.png", chart.draw_map(plan, cells))
        console.print(f"{len(cells)} of {len(plan.cells)} cells in {self.files.output_dir}", soft_wrap=True)


def choose(kind: str, names: Sequence[str], known: Sequence[T]) -> list[T]:
    """Return those of `known` that `names` lists, in their own order, or all; raises `OutputError` for an unknown name."""
    by_name = {each.name: each for each in known}  # type: ignore[attr-defined]
    for name in names:
        if name not in by_name:
            hint = did_you_mean(name, by_name)
            raise OutputError(f"{kind} {name!r} is unknown{hint} (known: {', '.join(by_name)})")
    return [each for name, each in by_name.items() if not names or name in names]


def prepare_folder(folder: Path, resume: bool, overwrite: bool) -> None:
    """Make `folder` ready: new, with an earlier map to go on with, or with an earlier map removed.

    Raises `OutputError` if it holds a map and neither `resume` nor `overwrite` says what to do, or both do.
    """
    if resume and overwrite:
        raise OutputError("--resume keeps what --overwrite removes; give one of them")
    require_folder(folder)
    found = [name for name in ARTEFACTS if (folder / name).exists()]
    if found and not (resume or overwrite):
        raise OutputError(
            f"{folder} already holds a map ({', '.join(found)}); give --resume or --overwrite, or choose another --output-dir"
        )
    if overwrite:
        remove(folder, found)
