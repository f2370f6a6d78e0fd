"""What is measured on a GPU, in one call of at most eight minutes: `taichi-rts bench --arch cuda --rows device`."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator

import taichi_rts as rts
from taichi_rts.benchmarks import timing
from taichi_rts.benchmarks.rows import Row, Settings, millions
from taichi_rts.benchmarks.scenes import peers_dam_break
from taichi_rts.device.backend import ti
from taichi_rts.rendering.painter import Painter, PictureOptions

CANDIDATES = 180  # pairs that a thread looks at with r = 2 spacings: 9 rows of 5 cells of 4
FLOPS = CANDIDATES * (24 + 42)
"""Operations of an update: those of a pair in the density pass and in the momentum pass, counted in the source; a root and a
division count as one."""
BYTES = 4 * (2 * 10 + 2 * 8 + 2 * 8 + 6)
"""Bytes of an update if caches were perfect: state read and written, what neighbours read written and read in two passes, and the
sort's indices."""
STREAM = 1 << 27  # entries of the arrays by which bandwidth is measured
CHAIN = 4096  # dependent multiply-adds of a thread, by which the rate is measured


def bandwidth_and_rate() -> tuple[float, float]:
    """Measure bytes/s of a copy and floating-point operations/s of multiply-adds."""
    a, b = ti.field(ti.f32, STREAM), ti.field(ti.f32, STREAM)

    @ti.kernel
    def copy():
        for i in a:
            b[i] = a[i]

    @ti.kernel
    def multiply():
        for i in range(STREAM // 16):
            x, y, z, w = a[i], a[i] + 1.0, a[i] + 2.0, a[i] + 3.0
            for _ in range(CHAIN):
                x, y, z, w = x * 0.999 + 1e-3, y * 0.999 + 1e-3, z * 0.999 + 1e-3, w * 0.999 + 1e-3
            b[i] = x + y + z + w

    return 8.0 * STREAM / _best(copy), 8.0 * CHAIN * (STREAM // 16) / _best(multiply)


def _best(kernel: Callable[[], None]) -> float:
    kernel()
    found = []
    for _ in range(5):
        ti.sync()
        began = clock.perf_counter()
        kernel()
        ti.sync()
        found.append(clock.perf_counter() - began)
    return min(found)


def device(settings: Settings) -> Iterator[Row]:
    """Uniform and regional at 4M particles, pictures at 60 a second of physical time, and 50M particles."""
    settings.start()
    bandwidth, rate = bandwidth_and_rate()
    yield Row("bandwidth of a copy", "", bandwidth / 1e9, "GB/s")
    yield Row("multiply-adds", "", rate / 1e12, "Tflop/s")
    limit = 1.0 / max(BYTES / bandwidth, FLOPS / rate)
    yield Row("limit of updates/s by these", "", limit / 1e6, "M/s", note=f"{BYTES} B and {FLOPS} flop an update")

    settings.start()
    scene = peers_dam_break(settings.cells(200))
    sim = rts.Simulation(scene, rts.Uniform(0.4))
    timing.pace(sim, 100)
    uniform = timing.median_of(timing.in_turn([sim], [40], settings.repeats)[0], lambda pace: pace.updates_per_second)
    size = millions(sim.count)
    yield Row("uniform, particle updates/s", size, uniform / 1e6, "M/s", ">= 500")
    yield Row("share of the limit", size, uniform / limit, "")
    painter = Painter(scene, PictureOptions())
    painter.paint(sim)
    ti.sync()
    began = clock.perf_counter()
    for _ in range(10):
        painter.paint(sim)
    picture = (clock.perf_counter() - began) / 10
    second = sim.count / sim.base_step / uniform
    yield Row(
        "60 pictures a second over the solver's time",
        size,
        60.0 * picture / second,
        "",
        "<= 0.1",
        f"{picture:.3f} s each",
    )
    del sim, painter

    for name, time in (("double_dam_break", 0.25), ("dam_break_drop", 0.2)):
        settings.start()
        scene = rts.load_scene(name, particles=str(settings.particles(1_500_000)))
        paper = rts.Simulation(scene, rts.Regional(preset="paper"))
        paper.advance_to(time)
        even = rts.Simulation(scene, rts.Uniform(0.4))
        timing.put(even, *paper.local_state()[:3])
        ours, theirs = timing.in_turn([paper, even], [36, 12], settings.repeats)
        gain = timing.median_of(theirs, lambda pace: pace.wall_per_step) / timing.median_of(
            ours, lambda pace: pace.wall_per_step
        )
        yield Row(f"paper's preset over uniform, {name}", millions(paper.count), gain, "x", ">= 1.8", f"at {time:g} s")
        del paper, even

    settings.start()
    sim = rts.Simulation(peers_dam_break(settings.cells(464)), rts.Uniform(0.4))
    timing.pace(sim, 2)
    timed = timing.pace(sim, 10)
    yield Row("uniform, particle updates/s", millions(sim.count), timed.updates_per_second / 1e6, "M/s")
