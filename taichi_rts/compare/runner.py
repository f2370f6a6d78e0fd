"""The comparison itself: references, baselines and all variants."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from taichi_rts.compare import references, sweeps
from taichi_rts.compare.grounds import Ground, curves, finite
from taichi_rts.compare.jobs import Job, Outcome, find_largest_stable, run
from taichi_rts.compare.measures import ERRORS, PARTED, Yardstick, judge, parting
from taichi_rts.compare.variants import LARGEST_STABLE, Variant, make_variants, smallest_step, uniform_variant
from taichi_rts.errors import Error
from taichi_rts.files.writing import write_json
from taichi_rts.scene.loading import scene_from
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.stepping.steppers import stepper_from
from taichi_rts.trials.executors import Task, collect, processes

COURANTS = (0.4, 0.6, 0.8)
SEARCH = 6
"""Runs that the search for the largest stable step takes, about."""
BUILD = 3000
"""Steps that could be done in the time that a `Simulation` is compiled in, about."""


@dataclasses.dataclass(frozen=True)
class Settings:
    """What to compare, and how.

    Attributes:
        steppers: names of `sweeps.kinds`.
        courants: the sweep's numbers (`sweeps.make_stepper`).
        sets: sweeps of other parameters, each "KEY=VALUE,VALUE".
        samples: number of equal intervals at whose ends runs are compared.
        repeats: how many times each run is timed.
        parted: relative L2 difference of velocities above which the two references have parted.
        arch, precision: what the variants run on; references are in double precision on the CPU.
        cache: folder of the references; None: `references.default_cache`.
    """

    steppers: tuple[str, ...] = sweeps.ONE_SOUND_SPEED
    courants: tuple[float, ...] = COURANTS
    sets: tuple[str, ...] = ()
    samples: int = 40
    repeats: int = 3
    parted: float = PARTED
    arch: str = "cpu"
    precision: str = "f32"
    cache: Path | None = None


class Silent:
    """Shows nothing. The command line passes an object that shows a bar."""

    def total(self, weight: float) -> None:
        """Take note of how much work there is."""

    def begin(self, description: str) -> None:
        """Say what runs now."""

    def advance(self, weight: float) -> None:
        """Take note that so much work is done."""


def compare(
    scene: Scene,
    settings: Settings | None = None,
    *,
    folder: Path | None = None,
    executor: Any = None,
    progress: Any = None,
) -> dict[str, Any]:
    """Run every variant on `scene` and return the report, plain data as in compare.json, without what `analysis.analyse` adds.

    `executor` is anything with `submit(function, argument)` that returns futures with `result()`: one of `concurrent.futures`
    with spawned processes (not threads: Taichi's state belongs to a process), a Dask `Client`, or `executors.Here()`. None: one
    process. In `folder`/runs every finished run is stored, and taken from there if it is the same run.
    Raises `Error` for sweeps that cannot be made and for references that do not survive.
    """
    settings = settings or Settings()
    if executor is None:
        with processes() as pool:
            return compare(scene, settings, folder=folder, executor=pool, progress=progress)
    return _Comparison(scene, settings, folder, executor, progress or Silent()).run()


def plan(scene: Scene, settings: Settings) -> tuple[list[tuple[Scene, dict[str, Any]]], list[Variant]]:
    """Return the scenes, each with what was changed in it, and the variants; raises `Error` for what cannot be built."""
    sets = [sweeps.parse_sweep(text) for text in settings.sets]
    sweeps.check(sets, settings.steppers)
    if settings.samples < 2 or settings.repeats < 1 or not settings.parted > 0.0:
        raise Error(
            f"samples {settings.samples}, repeats {settings.repeats}, parted {settings.parted:g}: at least 2, at least 1 and "
            "above 0 are needed; try 40, 3 and 0.01"
        )
    if scene.outlets:
        raise Error(
            f"the scene has {len(scene.outlets)} outlets, and runs are compared particle by particle; leave them out"
        )
    changes = sweeps.for_scene(sets, settings.steppers)
    scenes = list(zip(sweeps.scenes_of(scene, changes), changes, strict=True))
    return scenes, make_variants(scenes, settings.steppers, settings.courants, sets)


class _Comparison:
    """One comparison under way."""

    def __init__(self, scene: Scene, settings: Settings, folder: Path | None, executor: Any, progress: Any) -> None:
        self.settings = settings
        self.folder = folder / "runs" if folder is not None else None
        self.executor = executor
        self.progress = progress
        self.scenes, self.variants = plan(scene, settings)
        self.cache = settings.cache or references.default_cache()
        self.densities = [1.0] * len(self.scenes)

    def run(self) -> dict[str, Any]:
        """Make references and baselines, then the variants."""
        references.prepare_cache(self.cache)
        numbers = range(len(self.scenes))
        self.progress.total(
            sum(weight(self.job(variant)) for variant in self.variants)
            + sum(SEARCH * weight(self.stable_job(k)) + sum(map(weight, self.reference(k))) for k in numbers)
        )
        grounds = self.make_grounds()
        self.densities = [ground.largest_density for ground in grounds]
        stable = self.find_stable()
        variants = list(self.variants)
        for number, found in enumerate(stable):
            known = {v.courant for v in variants if v.scene == number and v.family == "uniform" and not v.options}
            if found["stable"] is not None and found["stable"] not in known:
                variants.append(uniform_variant(number, found["stable"], self.scenes[number][1], LARGEST_STABLE))
        variants.sort(key=lambda v: (v.scene, v.family != "uniform"))
        return {
            "scenes": [ground.facts() for ground in grounds],
            "largest_stable": stable,
            "variants": self.make_runs(variants, grounds),
        }

    def job(self, variant: Variant) -> Job:
        """Return the run of a variant as plain data."""
        s = self.settings
        scene = self.scenes[variant.scene][0].replace(**sweeps.changes_by(variant.family))
        return Job(
            scene.to_dict(),
            variant.stepper,
            s.samples,
            s.arch,
            s.precision,
            s.repeats,
            density=self.densities[variant.scene],
        )

    def reference(self, number: int) -> tuple[Job, Job]:
        """Return the two reference runs of a scene."""
        smallest = smallest_step([v for v in self.variants if v.scene == number])
        return references.reference_jobs(self.scenes[number][0].to_dict(), smallest, self.settings.samples)

    def stable_job(self, number: int) -> Job:
        """Return the search for the largest stable uniform step on a scene."""
        return dataclasses.replace(self.job(uniform_variant(number, 0.8, {}, LARGEST_STABLE)), repeats=1)

    def find_stable(self) -> list[dict[str, Any]]:
        """Find the largest stable uniform step on every scene."""
        jobs = [self.stable_job(k) for k in range(len(self.scenes))]
        names = [_title(changes) for _, changes in self.scenes]
        keys = [references.job_key(job, "largest stable") for job in jobs]
        tasks = [
            Task(f"searching the largest stable uniform step{name}", SEARCH * weight(job), find_largest_stable, job)
            for name, job in zip(names, jobs, strict=True)
        ]
        return self.collect(tasks, keys, lambda number, found: found)

    def make_grounds(self) -> list[Ground]:
        """Load or run the references of every scene."""
        grounds = []
        for number, (scene, changes) in enumerate(self.scenes):
            jobs = self.reference(number)
            keys = (references.job_key(jobs[0]), references.job_key(jobs[1]))
            found = {key: references.load(self.cache, key) for key in keys}
            missing = [k for k in range(2) if found[keys[k]] is None]
            tasks = [
                Task(
                    f"reference {k + 1} of 2 at λ={jobs[k].stepper['courant']:.3g}{_title(changes)}",
                    weight(jobs[k]),
                    run,
                    jobs[k],
                )
                for k in missing
            ]

            def keep(n: int, out: Outcome, missing=missing, keys=keys, found=found, tasks=tasks) -> None:
                if not out.survived:
                    raise Error(f"the {tasks[n].description} does not survive ({out.reason}); check the scene")
                found[keys[missing[n]]] = out.trajectory
                references.store(self.cache, keys[missing[n]], out.trajectory)
                self.progress.advance(tasks[n].weight)

            collect(self.executor, tasks, self.progress.begin, keep)
            for k in set(range(2)) - set(missing):
                self.progress.advance(weight(jobs[k]))
            reference, coarser = (each for key in keys if (each := found[key]) is not None)
            together = parting(coarser, reference, self.settings.parted)
            scale = Yardstick.of(scene, reference)
            courant = jobs[0].stepper["courant"]
            grounds.append(
                Ground(
                    scene,
                    changes,
                    keys,
                    reference,
                    coarser,
                    together,
                    scale,
                    courant,
                    not missing,
                    self.settings.parted,
                )
            )
        return grounds

    def make_runs(self, variants: Sequence[Variant], grounds: Sequence[Ground]) -> list[dict[str, Any]]:
        """Run what is not stored yet, and judge it."""
        jobs = [self.job(variant) for variant in variants]
        keys = [
            references.job_key(job, str(self.settings.parted), *grounds[v.scene].keys)
            for job, v in zip(jobs, variants, strict=True)
        ]
        tasks = [Task(v.label, weight(job), run, job) for job, v in zip(jobs, variants, strict=True)]

        def judged(number: int, out: Outcome) -> dict[str, Any]:
            ground = grounds[variants[number].scene]
            errors = judge(out.trajectory, ground.reference, ground.scale, ground.together) if out.survived else {}
            return {
                "survived": out.survived,
                "reason": out.reason,
                "device": out.device,
                "costs": out.costs,
                "errors": finite({name: errors.get(name) for name in ERRORS}),
                "curves": curves(out.trajectory),
            }

        results = self.collect(tasks, keys, judged)
        return [_describe(v) | result for v, result in zip(variants, results, strict=True)]

    def collect(
        self, tasks: Sequence[Task], keys: Sequence[str], keep: Callable[[int, Any], dict[str, Any]]
    ) -> list[dict[str, Any]]:
        """Return the results of tasks: stored ones from the folder, others run and stored."""
        results: dict[int, dict[str, Any]] = {}
        for number, key in enumerate(keys):
            stored = self.stored(key)
            if stored is not None:
                results[number] = stored
                self.progress.advance(tasks[number].weight)
        missing = [number for number in range(len(tasks)) if number not in results]

        def done(place: int, outcome: Any) -> None:
            number = missing[place]
            results[number] = keep(number, outcome)
            if self.folder is not None:
                data = {"key": keys[number], "description": tasks[number].description, "result": results[number]}
                write_json(self.folder / f"{keys[number][:16]}.json", data)
            self.progress.advance(tasks[number].weight)

        collect(self.executor, [tasks[number] for number in missing], self.progress.begin, done)
        return [results[number] for number in range(len(tasks))]

    def stored(self, key: str) -> dict[str, Any] | None:
        """Return the result that is stored under `key`; None if there is none, or it cannot be read."""
        if self.folder is None:
            return None
        try:
            data = json.loads((self.folder / f"{key[:16]}.json").read_text(encoding="utf-8"))
            return data["result"] if data["key"] == key else None
        except (OSError, ValueError, KeyError, TypeError):
            return None


def weight(job: Job) -> float:
    """About how much work a job is, in steps; only the progress bar depends on it."""
    scene = scene_from(job.scene)
    steps = scene.end_time / stepper_from(job.stepper).timeline(scene).tick
    return BUILD + job.repeats * steps


def _title(changes: dict[str, Any]) -> str:
    return f" with {sweeps.describe(changes)}" if changes else ""


def _describe(variant: Variant) -> dict[str, Any]:
    return dataclasses.asdict(variant) | {"series": variant.series, "label": variant.label}
