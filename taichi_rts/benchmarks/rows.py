"""What is measured on a CPU: each function returns rows of the table. Bars are the project's targets for speed."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import tempfile
import time as clock
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import taichi_rts as rts
from taichi_rts.benchmarks import peers, timing
from taichi_rts.benchmarks.memory import memory_of
from taichi_rts.benchmarks.scenes import FRONT_TIME, peers_dam_break
from taichi_rts.device.backend import ti
from taichi_rts.solver.stepping.regional import LARGEST_COURANT

SETTLED = 0.05  # [s]: the column has left its lattice


@dataclass(frozen=True)
class Row:
    """One figure: what is measured, at which size, its value and unit, and its target ("" if none).

    `particles` is the number where the figure belongs to a curve over it.
    """

    what: str
    size: str
    value: float
    unit: str
    bar: str = ""
    note: str = ""
    particles: int = 0

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Settings:
    """What the command line says: `scale` shrinks all sizes, for a trial."""

    arch: str = "cpu"
    peer_script: Path = peers.SCRIPT
    scale: float = 1.0
    repeats: int = 5

    def start(self) -> None:
        """Begin anew, with an empty device."""
        gc.collect()
        rts.init(self.arch, restart=True)

    def particles(self, count: int) -> int:
        """Scaled number of particles."""
        return max(2000, int(count * self.scale))

    def cells(self, count: int) -> int:
        """Scaled number of particles along an edge."""
        return max(12, round(count * self.scale ** (1.0 / 3.0)))

    @property
    def threads(self) -> int:
        """Threads that Taichi and the peer use."""
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def millions(count: float) -> str:
    """Write a number of particles."""
    return f"{count / 1e6:.2f}M" if count >= 1e6 else f"{count / 1e3:.0f}k"


def uniform_against_peer(settings: Settings) -> Iterator[Row]:
    """Updates per second with uniform steps, beside SPlisHSPlasH WCSPH before and after."""
    for cells in (settings.cells(40), settings.cells(60)):
        settings.start()
        sim = rts.Simulation(peers_dam_break(cells), rts.Uniform(0.4))
        peer_end = max(4e6 * settings.scale / sim.count, 4) * sim.base_step
        with_peer = peers.peer_is_there(settings.peer_script)
        seen = []
        sim.advance_to(SETTLED)
        own = []
        for _ in range(2):
            if with_peer and (run := peers.run_peer(settings.peer_script, "wcsph", cells, peer_end, settings.threads)):
                seen.append(run["updates_per_second"])
            own += timing.in_turn([sim], [max(5, int(1e6 / sim.count))], settings.repeats)[0]
        rate = timing.median_of(own, lambda pace: pace.updates_per_second)
        size = millions(sim.count)
        yield Row("uniform, particle updates/s", size, rate / 1e6, "M/s")
        if seen:
            yield Row("SPlisHSPlasH WCSPH, particle updates/s", size, float(np.mean(seen)) / 1e6, "M/s")
            yield Row("the ratio of both", size, rate / float(np.mean(seen)), "x", ">= 6")


def run_to_front(settings: Settings, scene: rts.Scene, stepper: rts.Regional) -> tuple[float, float, int]:
    """Run `scene` anew; return wall time per simulated second, where the front then is [m], and the number of particles."""
    settings.start()
    sim = rts.Simulation(scene, stepper)
    sim.advance_to(FRONT_TIME)
    return sim.statistics["wall_seconds"] / FRONT_TIME, float(sim.positions()[:, 0].max()), sim.count


def simulated_second(settings: Settings) -> Iterator[Row]:
    """Wall time per simulated second at the defaults of `Regional`, and where the front then is, beside SPlisHSPlasH.

    Ours is the median of the runs before and after each of the peer's.
    """
    bars = {"dfsph": (">= 2.5", ">= 4"), "wcsph": (">= 10", ">= 16")}
    methods = list(bars) if peers.peer_is_there(settings.peer_script) else []
    for cells in (settings.cells(40), settings.cells(60)):
        scene = peers_dam_break(cells)
        # The default's longest step with the regional sound speed as well, whose own default is shorter.
        ours = {
            "one sound speed": (scene, rts.Regional()),
            "regional sound speed": (scene.replace(sound_speed="regional"), rts.Regional(courant=LARGEST_COURANT)),
        }
        runs = {name: [run_to_front(settings, *each)] for name, each in ours.items()}
        theirs: dict[str, dict[str, float]] = {}
        for method in methods:
            if run := peers.run_peer(settings.peer_script, method, cells, FRONT_TIME, settings.threads):
                theirs[method] = run
                for name, each in ours.items():
                    runs[name].append(run_to_front(settings, *each))
        medians = {name: float(np.median([wall for wall, _front, _count in each])) for name, each in runs.items()}
        _wall, _front, count = runs["one sound speed"][0]
        size = millions(count)
        for name, wall in medians.items():
            _wall, front, _count = runs[name][-1]
            yield Row(f"Regional, {name}, wall s per simulated s", size, wall, "", note=f"front {front:.4f} m")
        for method, run in theirs.items():
            wall = run["wall_per_simulated_second"]
            note = f"front {run['front']:.4f} m"
            yield Row(f"SPlisHSPlasH {method.upper()}, wall s per simulated s", size, wall, "", note=note)
            for (name, own), bar in zip(medians.items(), bars[method], strict=True):
                yield Row(f"{method.upper()} over Regional, {name}", size, wall / own, "x", bar)


def regional_against_uniform(settings: Settings) -> Iterator[Row]:
    """The paper's preset against uniform steps of the same base step, in windows from the release to after the impact.

    In the paper's scheme, and with steps that end at multiples of their own length: then blocks of one level are due
    together, in long
    runs, instead of every second block at a time.
    """
    for name, bar, times in (
        ("double_dam_break", ">= 2.0", (0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)),
        ("dam_break_drop", ">= 1.8", (0.02, 0.1, 0.2, 0.3, 0.4, 0.5)),
    ):
        settings.start()
        scene = rts.load_scene(name, particles=str(settings.particles(300_000)))
        papers = [rts.Simulation(scene, rts.Regional(preset="paper", steps=steps)) for steps in (None, "half_octaves")]
        uniform = rts.Simulation(scene, rts.Uniform(0.4))
        walls, shares = np.zeros((len(times), 3)), np.zeros((len(times), 2))
        for k, time in enumerate(times):
            for paper in papers:
                paper.advance_to(time)
            timing.put(uniform, *papers[0].local_state()[:3])
            paces = timing.in_turn([*papers, uniform], [12, 12, 4], 3)
            walls[k] = [timing.median_of(each, lambda pace: pace.wall_per_step) for each in paces]
            shares[k] = [np.mean([pace.updates / pace.steps / uniform.count for pace in each]) for each in paces[:2]]
        size = millions(uniform.count)
        for n, what in enumerate(("paper's preset", "the same, steps aligned")):
            gains = " ".join(f"{gain:.2f}" for gain in walls[:, 2] / walls[:, n])
            note = f"due {shares[:, n].mean():.3f}; windows {gains}"
            yield Row(f"{what}, over uniform, {name}", size, walls[:, 2].sum() / walls[:, n].sum(), "x", bar, note)


def one_level(settings: Settings) -> Iterator[Row]:
    """The cost of regions where all blocks have one level."""
    settings.start()
    scene = peers_dam_break(settings.cells(60))
    sims = [rts.Simulation(scene, stepper) for stepper in (rts.Regional(levels=1, courant=0.4), rts.Uniform(0.4))]
    for sim in sims:
        sim.advance_to(SETTLED)
    ours, theirs = timing.in_turn(sims, [8, 8], 2 * settings.repeats)
    ratio = float(np.median([a.wall / b.wall for a, b in zip(ours, theirs, strict=True)]))
    yield Row("Regional(levels=1) over Uniform, wall", millions(sims[0].count), ratio, "x", "<= 1.05")


def sparse_steps(settings: Settings) -> Iterator[Row]:
    """The cost of a step in which few particles are due."""
    settings.start()
    scene = rts.load_scene("projectile", particles=str(settings.particles(100_000))).replace(sound_speed="regional")
    sim = rts.Simulation(scene, rts.Regional(courant=LARGEST_COURANT))
    sim.advance_to(0.4 * scene.end_time)
    due, wall = timing.timed_steps(sim, 600)
    share = timing.share_of_full_step(due, wall, sim.count, 0.1)
    note = f"{np.mean(due) / sim.count:.2f} due on average"
    yield Row("a step with 10 % due over a full one", millions(sim.count), share, "", "<= 0.15", note)


def cost_by_size(settings: Settings) -> Iterator[Row]:
    """Cost per update from 30k to 1.5M particles, all sizes in turn."""
    for stepper, bar in ((rts.Uniform(0.4), "<= 1.15"), (rts.Regional(), "")):
        settings.start()
        sims = [rts.Simulation(peers_dam_break(cells), stepper) for cells in map(settings.cells, (40, 60, 92, 145))]
        for sim in sims:
            timing.pace(sim, max(12, int(1.5e6 / sim.count)))
        paces = timing.in_turn(sims, [max(6, int(1e6 / sim.count)) for sim in sims], settings.repeats)
        costs = [1e9 / timing.median_of(each, lambda pace: pace.updates_per_second) for each in paces]
        for sim, cost in zip(sims, costs, strict=True):
            what = f"{stepper.name}, wall ns per update"
            yield Row(what, millions(sim.count), cost, "ns", particles=sim.count)
        yield Row(f"{stepper.name}, largest over smallest of these", "", max(costs) / min(costs), "x", bar)
        del sim, sims


def memory(settings: Settings) -> Iterator[Row]:
    """Bytes per fluid particle, of everything."""
    for name, stepper in (
        ("uniform", rts.Uniform()),
        ("regional", rts.Regional()),
        ("asynchronous", rts.Asynchronous()),
    ):
        for cells in (settings.cells(60), settings.cells(92)):
            settings.start()
            sim = rts.Simulation(peers_dam_break(cells), stepper)
            sizes = memory_of(sim)
            largest = ", ".join(f"{path} {size / sim.count:.0f}" for path, size in list(sizes.items())[:12])
            bar = "<= 200"
            yield Row(
                f"memory per particle, {name}", millions(sim.count), sum(sizes.values()) / sim.count, "B", bar, largest
            )
            del sim


def papers_sizes(settings: Settings) -> Iterator[Row]:
    """The paper's own sizes: 200 base steps timed, the whole run projected."""
    for name, particles in (("double_dam_break", 1_500_000), ("dam_break_drop", 2_200_000)):
        settings.start()
        scene = rts.load_scene(name, particles=str(settings.particles(particles)))
        sim = rts.Simulation(scene, rts.Regional(preset="paper"))
        timing.pace(sim, 10)
        timed = timing.pace(sim, 200)
        whole = timed.wall_per_step * scene.end_time / sim.base_step
        size = millions(sim.count)
        yield Row(
            f"200 base steps, {name}", size, timed.wall, "s", note=f"{timed.updates_per_second / 1e6:.2f} M updates/s"
        )
        yield Row(f"the whole run projected, {name}", size, whole / 3600.0, "h", note=f"{scene.end_time:g} s of water")
        del sim


def first_frame(settings: Settings) -> Iterator[Row]:
    """From the start of the process to the first frame of `make demo`'s scene, with a cold and a warm cache of kernels."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "TI_OFFLINE_CACHE_FILE_PATH": f"{folder}/cache"}
        for state, bar in (("cold", "<= 15"), ("warm", "<= 4")):
            output = Path(folder) / state
            command = [sys.executable, "-m", "taichi_rts", "run", "double_dam_break", "--arch", settings.arch]
            began = clock.perf_counter()
            run = subprocess.Popen(
                [*command, "--output-dir", str(output)],
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            while not (output / "frames" / "000000.png").is_file() and run.poll() is None:
                clock.sleep(0.01)
            waited = clock.perf_counter() - began
            if state == "cold":
                clock.sleep(2.0)
            run.terminate()
            run.wait()
            yield Row(f"start to first frame, {state} cache", "", waited, "s", bar)


def profile(settings: Settings) -> Iterator[Row]:
    """Time of each kernel of a uniform and of a regional run."""
    for name, stepper in (("uniform", rts.Uniform(0.4)), ("regional", rts.Regional(preset="paper"))):
        gc.collect()
        rts.init(settings.arch, restart=True, kernel_profiler=True)
        sim = rts.Simulation(peers_dam_break(settings.cells(60)), stepper)
        timing.pace(sim, 20)
        ti.profiler.clear_kernel_profiler_info()
        timed = timing.pace(sim, 40)
        sums: dict[str, float] = {}
        for record in _kernel_records():
            kernel = record.name.split("_c")[0] if "_c" in record.name else record.name
            sums[kernel] = sums.get(kernel, 0.0) + record.total_time
        for kernel, total in sorted(sums.items(), key=lambda item: -item[1])[:14]:
            yield Row(f"{name}: {kernel}", millions(sim.count), 1e6 * total / timed.updates, "ns/update")


def _kernel_records() -> list[Any]:
    profiler = ti.profiler.kernel_profiler.get_default_kernel_profiler()
    profiler._update_records()
    profiler._count_statistics()
    return list(profiler._statistical_results.values())


ROWS: dict[str, Callable[[Settings], Iterator[Row]]] = {
    "peer": uniform_against_peer,
    "second": simulated_second,
    "regional": regional_against_uniform,
    "one_level": one_level,
    "sparse": sparse_steps,
    "size": cost_by_size,
    "memory": memory,
    "papers_sizes": papers_sizes,
    "first_frame": first_frame,
}
