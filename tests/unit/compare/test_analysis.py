import csv
import io

import pytest
from rich.console import Console

from taichi_rts.compare import analysis, plot, table
from taichi_rts.compare.measures import ERRORS


def make_run(family, courant, wall, error, **more):
    costs = {"wall_seconds": wall, "particle_updates": 1000 * wall, "speedup_bound": 1.6, "pair_interactions": 1e5}
    costs |= {
        "base_steps": 10,
        "peak_memory_bytes": 2**27,
        "active_fraction": 0.5,
        "wall_seconds_all": [wall, 1.1 * wall],
    }
    errors = dict.fromkeys(ERRORS, 0.5) | {"velocities": error}
    label = f"{family} λ={courant:g}"
    stepper = {"levels": 8}
    return {
        "scene": 0, "family": family, "courant": courant, "series": family, "label": label, "options": {}, "changes": {},
        "role": "sweep", "equal_step": courant, "survived": True, "reason": "", "costs": costs, "errors": errors,
        "stepper": stepper,
    } | more  # fmt: skip


def make_report(*others, together=0.3):
    uniform = [
        make_run("uniform", 0.2, 4.0, 1e-3),
        make_run("uniform", 0.4, 2.0, 4e-3),
        make_run("uniform", 0.8, 1.0, 1e-1),
    ]
    ground = {"scene": {"name": "pond"}, "changes": {}, "particles": 100, "parting_time": together, "parted": True}
    ground |= {"parting_threshold": 0.01, "reference_courant": 0.025}
    ground["floor"] = dict.fromkeys(ERRORS, 1e-5)
    stable = {"stable": 0.8, "unstable": 0.84, "reason": "energy"}
    return {"scenes": [ground], "largest_stable": [stable], "variants": [*uniform, *others]}


def judged(*others, **more):
    report = analysis.analyse(make_report(*others, **more), "velocities", "wall")
    return report, {run["label"]: run for run in report["variants"]}


def test_speedups_are_over_both_baselines_and_at_equal_error():
    _, runs = judged(make_run("regional", 0.4, 1.6, 4e-3, equal_step=0.2))
    gains = runs["regional λ=0.4"]["speedups"]
    assert gains["equal_step"] == pytest.approx(4.0 / 1.6)
    assert gains["largest_stable"] == pytest.approx(1.0 / 1.6)
    assert gains["equal_error"] == pytest.approx(2.0 / 1.6)
    assert not gains["equal_error_is_bound"]
    assert gains["bound"] == 1.6
    assert runs["uniform λ=0.4"]["speedups"] is None


def test_the_bound_of_asynchronous_steps_is_over_their_longest():
    _, runs = judged(make_run("asynchronous", 0.4, 1.0, 4e-3))
    assert runs["asynchronous λ=0.4"]["speedups"]["bound"] == pytest.approx(1.6 / 8)


def test_a_run_that_did_not_survive_is_left_out_of_everything():
    dead = make_run("regional", 0.8, 0.1, None, survived=False, reason="blown up", costs={}, errors={})
    report, runs = judged(dead)
    assert runs["regional λ=0.8"]["speedups"] is None
    assert not runs["regional λ=0.8"]["pareto"]
    assert "regional" not in " ".join(report["verdict"])
    assert any("regional λ=0.8 did not survive: blown up" in line for line in table.notes(report, 0))
    rows = list(csv.DictReader(io.StringIO(table.to_csv(report).decode())))
    assert rows[-1]["survived"] == "False"
    assert rows[-1]["wall_seconds"] == ""


def test_the_verdict_says_no_where_uniform_steps_are_cheaper():
    report, _ = judged(make_run("regional", 0.4, 3.0, 4e-3))
    assert report["verdict"][1].startswith("No:")
    assert "regional λ=0.4, takes 1.50 times the time" in report["verdict"][1]
    assert "0.1: uniform (1 s)" in report["verdict"][0]


def test_a_tie_is_no_gain():
    report, _ = judged(make_run("regional", 0.4, 1.98, 4e-3))
    assert report["verdict"][1].startswith("No gain: at equal error (0.004) regional λ=0.4 comes to within 5%")


def test_the_verdict_says_yes_and_by_how_much():
    report, runs = judged(make_run("regional", 0.4, 0.5, 4e-3), make_run("paper", 0.4, 2.0, 0.2))
    assert report["verdict"][1].startswith("Yes: at equal error (0.004) regional λ=0.4 is 4.00 times as cheap")
    assert [label for label, run in runs.items() if run["pareto"]] == ["uniform λ=0.2", "regional λ=0.4"]
    assert runs["paper λ=0.4"]["speedups"]["equal_error_is_bound"]


def test_the_verdict_names_what_is_more_accurate_than_any_uniform_run():
    report, runs = judged(make_run("asynchronous", 0.2, 5.0, 1e-4))
    assert runs["asynchronous λ=0.2"]["speedups"]["equal_error"] is None
    assert "asynchronous λ=0.2 reaches 0.0001, which no uniform run here does" in report["verdict"][1]


def test_updates_may_be_the_cost():
    report = analysis.analyse(make_report(make_run("regional", 0.4, 1.0, 4e-3)), "velocities", "updates")
    assert "2.00 times as cheap as the best uniform, by updates" in report["verdict"][1]


def test_where_nothing_can_be_judged_it_says_why():
    report = make_report(together=0.0)
    for run in report["variants"]:
        run["errors"]["velocities"] = None
    lines = analysis.analyse(report, "velocities", "wall")["verdict"]
    assert "part before the first sample" in lines[0]
    assert plot.draw(analysis.analyse(report, "velocities", "wall"))[:4] == b"\x89PNG"


def test_the_plot_is_a_picture():
    dead = make_run("paper", 0.8, 0.1, None, survived=False, reason="blown up", costs={}, errors={})
    report, _ = judged(make_run("regional", 0.4, 0.5, 4e-3), dead)
    assert plot.draw(report)[:4] == b"\x89PNG"


def test_doubts_are_told():
    report, _ = judged()
    notes = " ".join(table.notes(report, 0))
    assert "1e-05, is 100 times smaller than the smallest here." in notes
    assert "busy" not in notes
    report["variants"][0]["costs"]["wall_seconds_all"] = [1.0, 1.5]
    report["scenes"][0]["floor"]["velocities"] = 6e-4
    notes = " ".join(table.notes(report, 0))
    assert "differ by up to 50%" in notes
    assert "1.67 times smaller than the smallest here; errors up to twice" in notes


def test_tables_fit_eighty_columns():
    report, _ = judged(make_run("asynchronous", 0.2, 5.0, 1e-4), make_run("paper", 0.4, 2.0, 0.2))
    for each in table.make_tables(report, 0):
        console = Console(width=80, record=True, file=io.StringIO())
        console.print(each)
        lines = console.export_text().splitlines()
        assert not any("…" in line for line in lines)
        assert any("asynchronous λ=0.2" in line for line in lines)
