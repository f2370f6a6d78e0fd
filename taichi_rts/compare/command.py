"""`taichi-rts compare SCENE`."""

from __future__ import annotations

import dataclasses
import platform
import shlex
import sys
from contextlib import AbstractContextManager
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

import taichi_rts as rts
from taichi_rts.compare import analysis, folder, references, sweeps, table
from taichi_rts.compare.measures import PARTED
from taichi_rts.compare.runner import COURANTS, Settings, compare, plan
from taichi_rts.device import forks
from taichi_rts.errors import Error
from taichi_rts.output.options import flat
from taichi_rts.scene.scene import Scene
from taichi_rts.terminal import Progress, console
from taichi_rts.trials import executors
from taichi_rts.trials.plotting import require_plots

DEFAULT_PARTICLES = {2: 500, 3: 1000}
"""By dimension: what a comparison with the default sweep does in about five minutes on two cores."""
ErrorName = Literal[
    "velocities",
    "positions",
    "front",
    "centre_of_mass",
    "kinetic_energy",
    "potential_energy",
    "density",
    "pressure",
    "momentum",
]


@dataclasses.dataclass(frozen=True)
class Judging:
    """How runs are judged."""

    error: ErrorName = "velocities"
    """By which error runs are judged and plotted."""
    cost: Literal["wall", "updates"] = "wall"
    """Against which cost: wall time or particle updates."""
    samples: int = 40
    """At how many equal intervals runs are compared."""
    parted: float = PARTED
    """Relative L2 difference of velocities above which the two references have diverged: matched errors are taken up to
    then."""
    repeats: int = 3
    """How many times each run is timed; the median counts."""


@dataclasses.dataclass(frozen=True)
class Machine:
    """Where and how runs are made."""

    arch: Literal["auto", "cuda", "vulkan", "cpu"] = "cpu"
    """Where the runs are made; references always on the CPU."""
    precision: Literal["f32", "f64"] = "f32"
    """Floating-point precision of the runs; references have f64."""
    workers: int = 1
    """Runs to make at the same time; more than 1 disturbs wall times."""
    dask: str | None = None
    """Address of a Dask scheduler to run on, or local for a cluster here (needs the extra `cluster`)."""


@dataclasses.dataclass(frozen=True)
class Files:
    """What is written, and where."""

    output_dir: Path | None = None
    """Folder for the results; by default out/compare/SCENE."""
    cache_dir: Path | None = None
    """Folder of references; by default $XDG_CACHE_HOME/taichi_rts/references, or ~/.cache in its place."""
    resume: bool = False
    """Take the finished runs that are in the output folder, and make the others."""
    overwrite: bool = False
    """Replace an earlier comparison in the output folder."""
    plot: bool = True
    """Draw work_precision.png (needs the extra `plots`)."""


@dataclasses.dataclass(frozen=True)
class Compare:
    """Find out which stepper, at which step, is worth it on a scene: error against cost, against a converged reference.

    Writes OUTPUT_DIR/compare.json, compare.csv, work_precision.png and every finished run in runs/. Uniform steps at
    each regional base step and at the largest stable step are added automatically. Exit codes: 0 done, 2 wrong input,
    130 interrupted.
    """

    scene: tyro.conf.Positional[str] = "dam_break_2d"
    """Name of a built-in scene (see `taichi-rts scenes`) or path of a TOML file."""
    steppers: str = ",".join(sweeps.ONE_SOUND_SPEED)
    """Which to compare, with commas between; paper is regional with the paper's preset."""
    courants: str = ",".join(f"{courant:g}" for courant in COURANTS)
    """Courant numbers dt c_s / r of the longest step (paper: of its base step), with commas between."""
    levels: str | None = None
    """Largest number of base steps in a step, with commas between; short for --set regional.levels=... and asynchronous."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """KEY=VALUE,VALUE: sweep a parameter of a stepper or of the scene, e.g. regional.alpha=0.2,0.4 or scene.sound_speed=30,40."""
    spacing: float | None = None
    """Initial particle spacing [m]."""
    particles: str | None = None
    """Number of fluid particles instead of a spacing; by default 500 in two dimensions, 1000 in three."""
    end_time: float | None = None
    """Physical time to run to [s]; by default the scene's own."""
    judging: tyro.conf.OmitArgPrefixes[Judging] = dataclasses.field(default_factory=Judging)
    machine: tyro.conf.OmitArgPrefixes[Machine] = dataclasses.field(default_factory=Machine)
    files: tyro.conf.OmitArgPrefixes[Files] = dataclasses.field(default_factory=Files)

    def __call__(self) -> None:
        """Run it."""
        if self.files.plot:
            require_plots()
        scene, settings = self.load(), self.settings()
        _, variants = plan(scene, settings)  # what cannot be built is said before anything runs or is written
        where = self.files.output_dir if self.files.output_dir is not None else Path("out") / "compare" / scene.name
        executor = self.executor()
        references.prepare_cache(settings.cache or references.default_cache())
        folder.prepare(where, resume=self.files.resume, overwrite=self.files.overwrite)
        self.announce(scene, settings, len(variants))
        try:
            with executor as chosen, Progress(f"compare {scene.name}") as progress:
                report = compare(scene, settings, folder=where, executor=chosen, progress=progress)
        except KeyboardInterrupt:
            kept = len(list((where / "runs").glob("*.json")))
            print(
                f"taichi-rts: interrupted; {kept} finished runs are in {where / 'runs'}; --resume goes on",
                file=sys.stderr,
            )
            raise SystemExit(130) from None
        report = self.facts() | analysis.analyse(report, self.judging.error, self.judging.cost)
        written = folder.write(where, report, with_plot=self.files.plot)
        for number in range(len(report["scenes"])):
            for each in table.make_tables(report, number):
                console.print(each)
            for line in table.notes(report, number):
                console.print(line, highlight=False, soft_wrap=True)
        for line in report["verdict"]:
            console.print(line, highlight=False, soft_wrap=True)
        console.print(", ".join(map(str, written)), soft_wrap=True, highlight=False)

    def load(self) -> Scene:
        """Load the scene at the size of a comparison."""
        changes = {key: getattr(self, key) for key in ("spacing", "end_time") if getattr(self, key) is not None}
        if self.particles is not None or self.spacing is not None:
            return rts.load_scene(self.scene, particles=self.particles, **changes)
        dim = rts.load_scene(self.scene).dim
        return rts.load_scene(self.scene, particles=DEFAULT_PARTICLES[dim], **changes)

    def settings(self) -> Settings:
        """Return what to compare; raises `Error` for lists that cannot be read."""
        steppers = sweeps.choose(self.steppers)
        sets = list(self.set)
        if self.levels is not None:
            sets += [f"{name}.levels={self.levels}" for name in ("regional", "asynchronous") if name in steppers]
        courants = sweeps.numbers(self.courants, "--courants")
        judging, machine = self.judging, self.machine
        return Settings(
            tuple(steppers),
            tuple(courants),
            tuple(sets),
            samples=judging.samples,
            repeats=judging.repeats,
            parted=judging.parted,
            arch=machine.arch,
            precision=machine.precision,
            cache=self.files.cache_dir,
        )

    def executor(self) -> AbstractContextManager[Any]:
        """Return where runs are made; raises `Error` for a missing package or a wrong number."""
        if self.machine.workers < 1:
            raise Error(f"--workers {self.machine.workers} is below 1; use 1, or as many as there are idle processors")
        if self.machine.dask is not None:
            executors.require_dask()
            return executors.dask(self.machine.dask, self.machine.workers)
        return executors.processes(self.machine.workers)

    def announce(self, scene: Scene, settings: Settings, count: int) -> None:
        """Say what was chosen."""
        console.print(
            f"{scene.name}: about {scene.volume / scene.spacing**scene.dim:,.0f} particles (spacing {scene.spacing:.4g} m) to "
            f"{scene.end_time:g} s; {', '.join(settings.steppers)} at λ = {', '.join(f'{c:g}' for c in settings.courants)}; "
            f"{count} runs, each timed {settings.repeats} times, on {settings.arch} in {settings.precision}",
            highlight=False,
            soft_wrap=True,
        )
        if self.machine.workers > 1:
            console.print("More than one worker: runs disturb each other's wall times; judge by --cost updates.")

    def facts(self) -> dict[str, Any]:
        """Return what the report says about how it was made."""
        return {
            "command": shlex.join(["taichi-rts", *sys.argv[1:]]),
            "settings": {
                name: str(value) if isinstance(value, Path) else value
                for name, value, _default in sorted(flat(self), key=lambda option: option[0])
            },
            "version": version("taichi_rts"),
            "versions": forks.versions() | {"numpy": version("numpy"), "python": platform.python_version()},
            "device": platform.processor() or platform.machine(),
        }
