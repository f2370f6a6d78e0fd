from types import SimpleNamespace

import pytest
from rich.console import Console

import taichi_rts as rts
from taichi_rts.assembly.work import speedup_bound
from taichi_rts.commands import report
from taichi_rts.medium.energy import Energy
from taichi_rts.readings.diagnosis import Diagnosis
from taichi_rts.sampling.sampling import sample

STATISTICS = {
    "base_steps": 100,
    "particle_updates": 250,
    "wall_seconds": 0.5,
    "active_fraction": 0.25,
    "overhead_fraction": 0.1,
    "stopped_by_domain": 0,
    "runaways": 0,
}
PASSES = {"passes": 50, "cells_per_pass": {"min": 1, "median": 7.0, "max": 1234}, "cycles": 13, "wakes": 4321}
PASSES |= {"clamped": 12, "extrapolations": 0}


def simulation(stepper, particles, updates, **more):
    statistics = {**STATISTICS, "level_fractions": particles, "update_fractions": updates, **more}
    return SimpleNamespace(
        sound=None,
        stepper=stepper,
        scene=rts.load_scene("dam_break"),
        schedule=SimpleNamespace(levels_double=stepper.name == "asynchronous"),
        keeps_momentum_budget=False,
        keeps_work=True,
        work=lambda: 0.0,
        base_step=0.0005,
        medium=SimpleNamespace(mass=0.01, sound_speed=10.0),
        count=100,
        statistics=statistics,
        energy=lambda: Energy(1.0, 2.0, 0.5),
    )


def rows(sim):
    return report.level_rows(sim, sim.statistics)


def with_statistics(updates):
    sim = simulation(rts.Regional(levels=len(updates)), updates, updates)
    return sim, sim.statistics


def test_every_regional_level_has_a_row():
    sim = simulation(rts.Regional(levels=3), [0.25, 0.75, 0.0], [0.4, 0.6, 0.0])
    assert rows(sim) == [
        ("1", "0.500", "25.00%", "40.00%"),
        ("2", "1.000", "75.00%", "60.00%"),
        ("3", "1.500", "0.00%", "0.00%"),
    ]


def test_of_1024_levels_only_octaves_in_use_have_a_row():
    particles, updates = [0.0] * 1024, [0.0] * 1024
    particles[3], particles[5], particles[1023] = 0.05, 0.15, 0.8
    updates[3], updates[5], updates[1023] = 0.2, 0.3, 0.5
    assert rows(simulation(rts.Asynchronous(levels=1024), particles, updates)) == [
        ("4–6", "2.000–3.000", "20.00%", "50.00%"),
        ("1024", "512.000", "80.00%", "50.00%"),
    ]


def test_table_shows_what_passes_cost(capsys, monkeypatch):
    sim = simulation(rts.Asynchronous(levels=2), [0.2, 0.8], [0.3, 0.7], **PASSES)
    monkeypatch.setattr(report, "console", Console(width=120))
    report.print_table(sim, Energy(1.0, 2.0, 1.0))
    words = " ".join(capsys.readouterr().out.split())
    for fact in (
        "level ┃ step [ms] ┃ share",
        "particles 100, spacing 0.025 m",
        "sound speed 10 m/s",
        "overhead (ε) 10.0% of a full step: work for all particles, due or not",
        "stopped by the domain 0 times a particle, at a face",
        "passes 50 in 13 cycles",
        "cells in a pass 1 to 1,234, median 7",
        "woken 4,321 particles",
        "steps too long 12: use more --levels",
        "extrapolations 0",
        "uniform, base step 0.500 ms: 1,000 updates, 4.00 of this run's, so about 2 s",
        "uniform, longest step 1.000 ms: 500 updates, 2.00 of this run's, so about 1 s",
        "energy dissipated 12.50% of 4 J at the start",
    ):
        assert fact in words
    report.print_table(simulation(rts.Regional(), [0.2, 0.8], [0.3, 0.7]), Energy(1.0, 2.0, 1.0))
    assert "pass" not in capsys.readouterr().out


def test_uniform_steps_are_as_long_as_sound_allows():
    steps = {row[0]: row[1] for row in report.uniform_facts(*with_statistics([0.0] * 9 + [1.0]))}
    assert steps["uniform, base step"].startswith("0.500 ms: 1,000 updates, 4.00 of this run's")
    assert steps["uniform, longest step"].startswith("3.000 ms: 167 updates, 0.67 of this run's")  # 0.6 r/c, not 5 ms


def test_longest_step_is_none_of_uniform_steps_where_sound_speeds_differ():
    sim, statistics = with_statistics([0.5, 0.5])
    sim.sound = object()
    assert [name for name, _fact in report.uniform_facts(sim, statistics)] == ["uniform, base step"]


def test_uniform_steps_are_held_against_nothing():
    sim, statistics = with_statistics([1.0])
    assert report.uniform_facts(sim, statistics | {"active_fraction": 1.0}) == []


def test_table_says_which_sizes_were_rounded(capsys, monkeypatch):
    sim = simulation(rts.Regional(), [0.2, 0.8], [0.3, 0.7])
    monkeypatch.setattr(report, "console", Console(width=120))
    report.print_table(sim, Energy(1.0, 2.0, 1.0))
    assert "rounded" not in capsys.readouterr().out
    sim.scene = rts.Scene(domain=rts.Box((0, 0), (3, 1)), fluids=[rts.Block((0, 0), (0.26, 0.59))], spacing=0.1)
    report.print_table(sim, Energy(1.0, 2.0, 1.0))
    words = " ".join(capsys.readouterr().out.split())
    assert "rows 0.095 x 0.09833 m apart, so that they fit" in words
    assert "rounded fluids.0: size rounded to 0.285 x 0.59 m, from 0.26 x 0.59 m" in words
    assert "volume 0.1681 of 0.1534 m^2 asked for (+9.6%)" in words


def test_energy_gained_asks_for_shorter_steps():
    start = Energy(1.0, 2.0, 1.0)
    assert report.energy_fact(0.004, start) == "0.40% of 4 J at the start"
    assert report.energy_fact(0.02, start) == "[bold yellow]2.00% of 4 J at the start[/]; use a smaller --courant"
    assert report.energy_fact(0.02, start, known=False) == "2.00% of 4 J at the start"


def test_speedup_bound_counts_the_passes_of_a_base_step():
    assert speedup_bound(0.5, 0.2) == pytest.approx(1 / 0.6)
    assert speedup_bound(0.5, 0.2, passes=0.25) == pytest.approx(1 / 0.45)


def test_a_run_that_blew_up_says_where_and_why(capsys, monkeypatch):
    diagnosis = Diagnosis(
        0.02, 7, (0.1, 0.25), (90.0, 0.0), 2, 1e-3, "speed 90 m/s reaches the limit", "an impact", "a smaller courant"
    )
    monkeypatch.setattr(report, "console", Console(width=120))
    sim = simulation(rts.Regional(), [0.2, 0.8], [0.3, 0.7], runaways=3)
    report.print_table(sim, Energy(1.0, 2.0, 1.0), diagnosis)
    words = " ".join(capsys.readouterr().out.split())
    assert "blown up limited 3 times" in words
    assert (
        "blown up at t = 0.02 s particle 7 at (0.1, 0.25) m, level 2 with a step of 1 ms: speed 90 m/s reaches the limit. "
        "Likely cause: an impact. Remedy: a smaller courant." in words
    )


def test_where_nothing_moves_at_the_start_a_change_of_energy_is_no_share_of_it(capsys, monkeypatch):
    monkeypatch.setattr(report, "console", Console(width=120))
    sim = simulation(rts.Uniform(), [1.0], [1.0])
    assert report.energy_scale(sim) == 0.5  # 1 kg at a tenth of 10 m/s
    report.print_table(sim, Energy(0.0, 0.0, 1.7e-7))
    words = " ".join(capsys.readouterr().out.split())
    assert "energy gained 3.5 J; at the start there was next to none" in words
    assert "smaller --courant" not in words
    report.print_table(sim, Energy(0.0, 0.0, 1.0))
    assert "energy gained 250.00% of 1 J at the start; use a smaller --courant" in " ".join(
        capsys.readouterr().out.split()
    )


def test_the_list_of_scenes_counts_what_a_run_has(capsys, monkeypatch):
    monkeypatch.setattr(report, "console", Console(width=160))
    scenes = [rts.load_scene(name) for name in ("double_dam_break", "torricelli")]
    report.print_scenes(scenes)
    out = capsys.readouterr().out
    assert "end [s]" in out
    for scene, count in zip(scenes, (35_640, len(sample(scenes[1]).positions)), strict=True):
        assert f"{count:,}" in next(line for line in out.splitlines() if f" {scene.name} " in line)
