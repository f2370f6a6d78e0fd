"""What a user sees in the terminal: a progress bar while it runs, tables when it is done."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from taichi_rts.device import forks
from taichi_rts.device.backend import Backend
from taichi_rts.medium.energy import Energy
from taichi_rts.readings.diagnosis import Diagnosis
from taichi_rts.readings.levels import level_classes, milliseconds
from taichi_rts.sampling.filling import filling
from taichi_rts.sampling.sampling import fluid_positions
from taichi_rts.scene.checks.size import size_of
from taichi_rts.scene.scene import Scene
from taichi_rts.simulation import Simulation
from taichi_rts.terminal import Progress, console, rate

NOTABLE_GAIN = 0.01
"""Share of its energy that a run may gain without a warning, as in the conformance tests."""
LONGEST_STEP = 0.6
"""Longest uniform step [r/c_s] that a run is held against: what the stability map shows to hold everywhere."""
LITTLE_ENERGY = 1e-4
"""If the energy at the start is a smaller share of what could move than this, changes are given in J, not in
percent."""

QUICKLY_COUNTED = 1e6
"""Particles that are laid out only to be counted, at most."""


def announce(scene: Scene, runs: int, device: Backend) -> None:
    """Say what begins: the first of all takes long, as kernels are compiled and kept for the next run."""
    about = size_of(scene).particles
    particles = f"about {about:,.0f}" if about > QUICKLY_COUNTED else f"{sum(map(len, fluid_positions(scene))):,}"
    count = f"{particles} particles, spacing {scene.spacing:.4g} m, to {scene.end_time:g} s"
    each = f", {runs} runs" if runs > 1 else ""
    console.print(
        f"{scene.name}: {count}, on {device.arch}{each}; compiling ...", soft_wrap=True, highlight=False, markup=False
    )


@contextmanager
def progress(
    runs: Mapping[Any, Simulation], end_time: float, look: Callable[[], None] = lambda: None
) -> Iterator[Callable[[float], None]]:
    """Show how far the runs are, with active fraction and updates/s; yields what to call after each frame, at its time [s].

    `look` is called at each frame.
    """
    sims = list(runs.values())

    def reached() -> float:
        return min(end_time, *(sim.solver.timeline.time for sim in sims))

    with Progress(sims[0].scene.name, end_time, reached) as shown:
        shown.begin("compiling")

        def on_frame(time: float) -> None:
            look()
            statistics = [sim.statistics for sim in sims]
            updates = sum(s["particle_updates"] for s in statistics)
            seconds = sum(s["wall_seconds"] for s in statistics)
            active = statistics[0]["active_fraction"]
            shown.reach(time, f"t = {time:.3f} of {end_time:g} s, active {active:.0%}, {rate(updates, seconds)}")

        yield on_frame


def print_table(
    sim: Simulation,
    initial_energy: Energy,
    diagnosis: Diagnosis | None = None,
    more: Sequence[tuple[str, str]] = (),
) -> None:
    """Print shares per level, active fraction, updates/s, bound of the speed-up, energy, `more` facts, and a diagnosis."""
    statistics = sim.statistics
    levels = Table(title=f"{sim.scene.name}, {sim.stepper.name} steps", title_justify="left")
    for heading in ("level", r"step \[ms]", "share of particles", "share of updates"):
        levels.add_column(heading, justify="right")
    for row in level_rows(sim, statistics):
        levels.add_row(*row)
    console.print(levels)

    energy = sim.energy()
    work = sim.work() if sim.keeps_work else 0.0
    gain, scale = energy.total - work - initial_energy.total, energy_scale(sim)
    drift = gain / abs(initial_energy.total) if initial_energy.total else 0.0
    facts = Table(show_header=False, box=None)
    facts.add_row("particles", f"{sim.count:,}, spacing {sim.scene.spacing:.4g} m")
    for name, fact in filling(sim.scene).facts(sim.scene.spacing):
        facts.add_row(name, fact)
    active, base_steps = statistics["active_fraction"], statistics["base_steps"]
    facts.add_row("active fraction", f"{active:.3f}")
    facts.add_row("base steps", f"{base_steps:,} in {statistics['wall_seconds']:.2f} s")
    facts.add_row("updates", rate(statistics["particle_updates"], statistics["wall_seconds"]))
    if statistics["overhead_fraction"] is not None:
        facts.add_row(
            "overhead (ε)", f"{statistics['overhead_fraction']:.1%} of a full step: work for all particles, due or not"
        )
    for name, fact in uniform_facts(sim, statistics):
        facts.add_row(name, fact)
    for name, fact in pass_facts(statistics):
        facts.add_row(name, fact)
    if sim.keeps_momentum_budget:
        share = np.linalg.norm(sim.momentum_drift()) / (
            sim.medium.mass * sim.count * max(sim.scene.estimate_max_speed(), 1e-9)
        )
        facts.add_row("momentum drift", f"{share:.1e} of the mass times the largest speed")
    if statistics.get("extrapolations") is not None:
        facts.add_row("extrapolations", str(statistics["extrapolations"]))
    fact = energy_fact(drift, initial_energy, known=sim.keeps_work)
    if abs(initial_energy.total) < LITTLE_ENERGY * scale:  # hardly anything moves at the start, or could fall
        fact = f"{abs(gain):.3g} J; at the start there was next to none"
    facts.add_row("energy " + ("gained" if gain > 0.0 else "dissipated"), fact)
    if work:
        facts.add_row("work put in", f"{work:+.4g} J, counted apart")
    if not sim.keeps_work:
        facts.add_row("", "with the work of walls and inflows; --debug tells them apart")
    for name, fact in more:
        facts.add_row(name, fact)
    if sim.sound is None:
        facts.add_row("sound speed", f"{sim.medium.sound_speed:.4g} m/s")
    else:
        c = sim.sound_speeds()
        facts.add_row("sound speed", f"{c.min():.3g} to {c.max():.3g} m/s at the end, mean {c.mean():.3g}")
        if sim.particles.has_budget:
            facts.add_row("put in by its changes", f"{sim.sound_work():+.3g} J, in the energy above")
    for number, removed in enumerate(statistics.get("removed_by_outlets", [])):
        facts.add_row(f"outlet {number}", f"{removed:,} particles, {removed * sim.medium.mass:.4g} kg")
    facts.add_row("stopped by the domain", f"{statistics['stopped_by_domain']:,} times a particle, at a face")
    if sim.scene.obstacles:
        facts.add_row("stopped by obstacles", f"{statistics['stopped_by_obstacles']:,} times a particle, at a surface")
    if statistics["runaways"]:
        facts.add_row("[bold red]blown up[/]", f"limited {statistics['runaways']:,} times; use a smaller --courant")
    console.print(facts)
    if diagnosis is not None:
        print_diagnosis(diagnosis)


def energy_scale(sim: Simulation) -> float:
    """Kinetic energy [J] that all fluid has at a tenth of the sound speed: what the sound speed expects to move."""
    return 0.5 * sim.medium.mass * sim.count * (0.1 * sim.medium.sound_speed) ** 2


def energy_fact(drift: float, initial: Energy, *, known: bool = True) -> str:
    """A change of energy as a share of the `initial` one: water loses some, much in a splash, and must not gain any.

    With `known` the work of walls and inflows is left out of it.
    """
    fact = f"{abs(drift):.2%} of {initial.total:.4g} J at the start"
    return f"[bold yellow]{fact}[/]; use a smaller --courant" if known and drift > NOTABLE_GAIN else fact


def print_diagnosis(diagnosis: Diagnosis) -> None:
    """Say when and why a run blew up, and what to do about it."""
    console.print(f"[bold red]blown up[/] {diagnosis}", soft_wrap=True, highlight=False)


def level_rows(sim: Simulation, statistics: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Return level, step [ms], share of particles and of updates as text; where levels double, a row for each octave in use."""
    particles, updates = statistics["level_fractions"], statistics["update_fractions"]
    rows = []
    for each in level_classes(particles, sim.schedule.levels_double):
        if each.share > 0.0 or not sim.schedule.levels_double:
            steps = [milliseconds(n * sim.base_step) for n in sorted({each.first, each.last})]
            share = sum(updates[each.first - 1 : each.last])
            rows.append((str(each), "–".join(steps), f"{each.share:.2%}", f"{share:.2%}"))
    return rows


def uniform_facts(sim: Simulation, statistics: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what uniform steps of this run's base step, and of its longest step, would have taken.

    Their time is what this run has paid for an update, times their updates. The longest step is at most `LONGEST_STEP` r/c_s.
    With a regional sound speed it is left out: the longest steps are then those of regions where sound is slow.
    """
    used = np.flatnonzero(statistics["update_fractions"])
    if statistics["active_fraction"] in (0.0, 1.0) or not len(used):
        return []
    updates, seconds = statistics["particle_updates"], statistics["wall_seconds"]
    base = sim.base_step
    steps = [("base", base)]
    if sim.sound is None:
        limit = LONGEST_STEP * sim.scene.support / sim.medium.sound_speed
        steps.append(("longest", max(base, min((int(used[-1]) + 1) * base, limit))))
    found = []
    for name, step in steps:
        ratio = base / (step * statistics["active_fraction"])
        found.append(
            (
                f"uniform, {name} step",
                f"{milliseconds(step)} ms: {updates * ratio:,.0f} updates, {ratio:.2f} of this run's, "
                f"so about {seconds * ratio:.3g} s",
            )
        )
    return found


def pass_facts(statistics: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return facts about the passes of a stepper that works in passes."""
    if "passes" not in statistics:
        return []
    cells = statistics["cells_per_pass"]
    return [
        ("passes", f"{statistics['passes']:,} in {statistics['cycles']:,} cycles"),
        ("cells in a pass", f"{cells['min']:,} to {cells['max']:,}, median {cells['median']:,.0f}"),
        ("woken", f"{statistics['wakes']:,} particles"),
        *(
            [("[bold]steps too long[/]", f"{statistics['clamped']:,}: use more --levels")]
            if statistics["clamped"]
            else []
        ),
    ]


def print_folder(folder: Path, frames: int, files: Mapping[str, Any]) -> None:
    """Say where the results are."""
    pictures = f"{frames} frames in {folder / 'frames'}, " if "frames" in files else ""
    exports = {path: None for path in files.values() if isinstance(path, str) and "/NNNNNN" in path}
    exports.pop("frames/NNNNNN.png", None)
    particles = f"files of {frames} frames in {', '.join(str(folder / path) for path in exports)}, " if exports else ""
    series = f"time series in {folder / files['series'][0]}, "
    console.print(f"{pictures}{particles}{series}facts in {folder / 'run.json'}", soft_wrap=True, markup=False)


def print_finished(folder: Path, end_time: float) -> None:
    """Say that the run is finished already."""
    console.print(
        f"{folder} is finished (t = {end_time:g} s); a later --end-time goes on, --overwrite runs again from the checkpoint",
        soft_wrap=True,
        highlight=False,
        markup=False,
    )


def print_scenes(scenes: list[Scene]) -> None:
    """Print a table of scenes."""
    table = Table("name", "dim", "particles", r"end \[s]", "what it is")
    for scene in scenes:
        count = sum(map(len, fluid_positions(scene)))
        table.add_row(scene.name, str(scene.dim), f"{count:,}", f"{scene.end_time:g}", scene.description)
    console.print(table)


def print_info(support: Mapping[str, str]) -> None:
    """Print versions and arches."""
    table = Table("what", "here", show_header=False)
    for name, found in {"taichi_rts": version("taichi_rts"), **forks.versions(), "numpy": version("numpy")}.items():
        table.add_row(name, found)
    table.add_row("python", platform.python_version())
    for arch, state in support.items():
        table.add_row(f"arch {arch}", state)
    console.print(table)
