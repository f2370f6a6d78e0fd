"""The suite: every case with every stepper. A cell of the map is one bisection, kept on disk as soon as it is done."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from importlib.metadata import version
from pathlib import Path
from typing import Any

import taichi_rts as rts
from taichi_rts.errors import SceneError
from taichi_rts.files.writing import write_json
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.stepping.base import Setup, Stepper
from taichi_rts.solver.stepping.steppers import setups
from taichi_rts.stability.cases import Case
from taichi_rts.trials.demands import demanded_density
from taichi_rts.trials.executors import processes
from taichi_rts.trials.rerun import Rerun
from taichi_rts.trials.survival import Outcome, largest_stable, watch

LOWEST, HIGHEST = 0.05, 2.0  # courants between which the largest stable one is looked for; steppers take no more than 2
REFERENCE_COURANTS = (0.1, 0.05, 0.025)


@dataclasses.dataclass(frozen=True)
class Setting:
    """A stepper with all but its courant fixed.

    `make` takes a courant and returns the stepper; `default` is the courant that it has without one. `changes` are what it
    changes in a case's scene.
    """

    name: str
    make: Callable[[float], Any]
    default: float
    changes: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def scene(self, case: Case) -> Scene:
        """Return the scene of `case` as it is run here; raises `SceneError` where that makes no sense (`unfit`)."""
        return case.scene.replace(**self.changes) if self.changes else case.scene

    def unfit(self, case: Case) -> str:
        """Say why `case` cannot be run with this setting; empty if it can."""
        try:
            self.scene(case)
        except SceneError as error:
            return str(error).removeprefix("Scene: ")
        return ""


def _setting(kind: Any, setup: Setup) -> Setting:
    default = setup.courant if setup.courant is not None else kind(**setup.parameters).own_courant
    changes = {"sound_speed": "regional"} if setup.regional_sound else {}
    return Setting(setup.name, lambda courant: kind(courant=courant, **setup.parameters), default, changes)


SETTINGS: tuple[Setting, ...] = tuple(_setting(kind, setup) for kind, setup in setups("mapped").values())
"""All steppers, in the order of the map's columns; those that end in "-c" run with the regional sound speed."""


@dataclasses.dataclass(frozen=True)
class Plan:
    """What to run: `cases` by `settings`, to a relative `tolerance` or `quick` (the defaults only), on a device."""

    cases: Sequence[Case]
    settings: Sequence[Setting]
    tolerance: float = 0.05
    quick: bool = False
    arch: str = "cpu"
    precision: str = "f32"

    @property
    def cells(self) -> list[tuple[Case, Setting]]:
        """All cells that can be run, case by case."""
        return [
            (case, setting)
            for case in self.cases
            for setting in self.settings
            if (case.name, setting.name) not in self.skipped
        ]

    @functools.cached_property
    def skipped(self) -> dict[tuple[str, str], str]:
        """Why a case cannot be run with a setting, by the names of both."""
        unfit = {(case.name, setting.name): setting.unfit(case) for case in self.cases for setting in self.settings}
        return {names: reason for names, reason in unfit.items() if reason}

    def key(self, case: Case, setting: Setting | None) -> str:
        """Say what a stored result depends on, as a hash: scene, stepper, search and device, but not the solver's code."""
        stepper = None if setting is None else repr(setting.make(setting.default))
        search = (self.tolerance, self.quick, LOWEST, HIGHEST) if setting else REFERENCE_COURANTS
        scene = case.scene if setting is None else setting.scene(case)
        facts = [scene.to_dict(), case.samples, stepper, search, self.arch, self.precision, version("taichi_rts")]
        return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:16]

    def fresh(self) -> None:
        """Start Taichi anew, which frees the fields of earlier runs."""
        rts.init(self.arch, self.precision, restart=True, unrolling_limit=0)  # `Rewind` unrolls over all fields


@dataclasses.dataclass(frozen=True)
class Cell:
    """One cell of the map.

    Attributes:
        case, setting, default: their names, and the stepper's default courant.
        demanded: density over rest that the case demands.
        stable, unstable, reason: as in `survival.Bracket`; None and "" where `quick` did not look.
        longest: Courant number of the longest step that was taken at `stable`.
        outcome: how the run at the default went.
        runs: the courants tried.
    """

    case: str
    setting: str
    default: float
    demanded: float
    stable: float | None
    unstable: float | None
    reason: str
    longest: float | None
    outcome: Outcome
    runs: tuple[float, ...]

    def plain(self) -> dict[str, Any]:
        """Return it as data that JSON can hold."""
        return _plain(dataclasses.asdict(self))

    @classmethod
    def load(cls, data: dict[str, Any]) -> Cell:
        """Rebuild a cell from its JSON."""
        return cls(**(data | {"outcome": Outcome(**data["outcome"]), "runs": tuple(data["runs"])}))


def run_plan(plan: Plan, folder: Path, on_cell: Callable[[str], None], workers: int = 1) -> Iterator[Cell]:
    """Yield all cells: from `folder` where they are stored there under the same key, else run and stored.

    `on_cell` is told what comes next. With several `workers` each case is done by one process, and cells come as cases are done.
    """
    if workers == 1:
        for case, setting in plan.cells:
            on_cell(f"{case.name} with {setting.name}")
            yield stored_cell(plan, case, setting, folder)
        return
    with processes(workers) as pool:
        names = tuple(setting.name for setting in plan.settings)
        parts = [dataclasses.replace(plan, cases=(case,), settings=()) for case in plan.cases]
        futures = {pool.submit(_run_part, part, names, folder): part.cases[0].name for part in parts}
        on_cell(f"{len(parts)} cases in {workers} processes")
        for future in as_completed(futures):
            on_cell(f"{futures.pop(future)} is done")
            yield from future.result()


def _run_part(part: Plan, names: Sequence[str], folder: Path) -> list[Cell]:
    """Run a plan in a process of its own; settings come by name, because functions without one cannot be sent."""
    settings = [setting for setting in SETTINGS if setting.name in names]
    return list(run_plan(dataclasses.replace(part, settings=settings), folder, lambda what: None))


def stored_cell(plan: Plan, case: Case, setting: Setting, folder: Path) -> Cell:
    """Return a cell from `folder`, where it is put if it is not there."""
    path, key = folder / "cells" / f"{case.name}--{setting.name}.json", plan.key(case, setting)
    stored = _read(path, key)
    if stored is not None:
        return Cell.load(stored["cell"])
    cell = run_cell(plan, case, setting, _demanded(plan, case, folder))
    write_json(path, {"key": key, "cell": cell.plain()})
    return cell


def run_cell(plan: Plan, case: Case, setting: Setting, demanded: float) -> Cell:
    """Bisect one cell, or only try its default."""
    scene, build = setting.scene(case), None if plan.quick else Rerun(plan.fresh)

    def run(scene: rts.Scene, stepper: Stepper) -> Outcome:
        return watch(scene, stepper, samples=case.samples, demanded_density=demanded, build=build)

    if plan.quick:
        plan.fresh()
        outcome = run(scene, setting.make(setting.default))
        runs: tuple[tuple[float, Outcome], ...] = ((setting.default, outcome),)
        stable, unstable = (setting.default, None) if outcome.survived else (None, setting.default)
        reason = outcome.reason
    else:
        bracket = largest_stable(scene, setting.make, LOWEST, HIGHEST, plan.tolerance, first=setting.default, run=run)
        runs, stable, unstable, reason = bracket.runs, bracket.stable, bracket.unstable, bracket.reason
    longest = next((outcome.courant for courant, outcome in runs if courant == stable), None)
    tried = tuple(courant for courant, _ in runs)
    return Cell(
        case.name, setting.name, setting.default, demanded, stable, unstable, reason, longest, runs[0][1], tried
    )


def reference_density(case: Case, fresh: Callable[[], Any]) -> float:
    """Largest density over rest that `case` demands of this discretisation.

    Behind a shock, single particles overshoot the jump however short the steps are: the lattice of particles has next to no
    dissipation at that scale. So where shocks meet particles, three runs with short uniform steps say what the case demands,
    if that is more than `demands.demanded_density`. Three, because which particle is hit hardest is chaotic.
    """
    scene, build = case.scene, Rerun(fresh)
    demanded = demanded_density(scene)
    for courant in REFERENCE_COURANTS if case.shocks else ():
        stepper = SETTINGS[0].make(courant)
        outcome = watch(scene, stepper, samples=case.samples, demanded_density=math.inf, build=build)
        if outcome.survived:
            demanded = max(demanded, outcome.density)
    return demanded


def _demanded(plan: Plan, case: Case, folder: Path) -> float:
    path, key = folder / "cells" / f"{case.name}--reference.json", plan.key(case, None)
    stored = _read(path, key)
    if stored is None:
        stored = {"key": key, "demanded": reference_density(case, plan.fresh), "formula": demanded_density(case.scene)}
        write_json(path, stored)
    return stored["demanded"]


def _read(path: Path, key: str) -> dict[str, Any] | None:
    """Return what is stored at `path` if it belongs to `key`."""
    try:
        data = json.loads(path.read_text())
    except (OSError, ValueError):
        return None
    return data if isinstance(data, dict) and data.get("key") == key else None


def _plain(data: Any) -> Any:
    """Replace numbers that JSON cannot hold, as of a run that blew up, by 1e300."""
    if isinstance(data, dict):
        return {key: _plain(value) for key, value in data.items()}
    if isinstance(data, float) and not math.isfinite(data):
        return 1e300
    return data
