import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.assembly.resources import device_bytes
from taichi_rts.benchmarks import peers, timing
from taichi_rts.benchmarks.command import Bench, verdict
from taichi_rts.benchmarks.memory import memory_of
from taichi_rts.benchmarks.plot import draw
from taichi_rts.benchmarks.rows import Row, Settings, millions
from taichi_rts.benchmarks.scenes import peers_dam_break


def test_a_step_with_few_due_is_read_off_a_line_that_disturbed_steps_do_not_bend():
    rng = np.random.default_rng(0)
    due = rng.choice([200, 1000, 2500, 5000, 10000], 400)
    wall = 1e-3 + 9e-7 * due
    wall[::17] *= 5.0
    assert timing.share_of_full_step(due, wall, 10000, 0.1) == pytest.approx((1e-3 + 9e-4) / (1e-3 + 9e-3), rel=1e-6)


def test_verdicts_go_by_the_bar():
    bars = [("", ""), (">= 6", "yes"), (">= 6.1", "no"), ("<= 6", "yes"), ("<= 5.9", "no")]
    assert [verdict(Row("", "", 6.0, "x", bar)) for bar, _ in bars] == [wanted for _, wanted in bars]
    assert [millions(n) for n in (31_400, 1_520_000)] == ["31k", "1.52M"]


def test_memory_counts_every_field_once(taichi_cpu, unstarted):
    scene = peers_dam_break(12)
    sim = rts.Simulation(scene, rts.Uniform())
    sizes = memory_of(sim)
    assert sizes["solver.particles.x"] == sizes["solver.particles.a"] == 12 * sim.count
    assert sizes["solver.particles.updated"] == 4 * sim.count
    assert list(sizes.values()) == sorted(sizes.values(), reverse=True)
    assert any(".inside." in path for path in sizes)  # windows
    assert not any(size for path, size in sizes.items() if "real" in path)  # components of vectors, and others' fields
    estimated = device_bytes(sim.scene, sim.stepper, "f32")
    assert 0.8 * estimated < sum(sizes.values()) <= estimated
    assert Settings(scale=0.1).cells(60) == round(60 * 0.1 ** (1 / 3))


def test_without_the_peer_nothing_is_run(tmp_path):
    assert not peers.peer_is_there(tmp_path / "missing.py")
    assert Bench().peer_script == peers.SCRIPT


def test_the_plot_has_a_line_for_each_curve():
    rows = [Row(name, "", 100.0 + n, "ns", particles=1000 * 2**n) for name in ("uniform", "regional") for n in range(4)]
    size = np.frombuffer(draw(rows)[16:24], ">u4")  # width and height in the header of the PNG
    assert size.tolist() == [980, 560]
    assert draw(rows) != draw(rows[:4])
    assert len(draw([])) > 1000
