import contextlib
import json

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.assembly.rewind import Rewind
from taichi_rts.commands.main import main
from taichi_rts.compare import compare, jobs, references
from taichi_rts.compare.jobs import Job
from taichi_rts.compare.runner import Settings
from taichi_rts.device.backend import ti
from taichi_rts.solver.stepping.steppers import stepper_data
from taichi_rts.trials import executors
from taichi_rts.trials.executors import Here, Task, collect

pytestmark = pytest.mark.usefixtures("quick_environment")

SIZE = ["--particles", "100", "--end-time", "0.02", "--samples", "4", "--repeats", "2"]


@pytest.fixture
def quick_jobs(monkeypatch, quick):
    """Runs compile a quarter faster, in this process, and the largest stable step is searched for coarsely."""
    init, search = rts.init, jobs.largest_stable
    monkeypatch.setattr(rts, "init", lambda *args, **options: init(*args, **(options | quick)))
    monkeypatch.setattr(executors, "processes", lambda workers=1: contextlib.nullcontext(Here()))
    monkeypatch.setattr(jobs, "largest_stable", lambda *args, **options: search(*args, tolerance=1.0, **options))
    yield
    ti.reset()


@pytest.mark.slow
@pytest.mark.parametrize("stepper", [rts.Regional(preset="paper"), rts.Asynchronous(stagger=1)])
def test_a_rewound_simulation_gives_the_same_bits(start_taichi, quick, stepper):
    with start_taichi(unrolling_limit=0, **quick):
        check_rewind(stepper)


def check_rewind(stepper):
    sim = rts.Simulation(rts.load_scene("dam_break_2d", particles=100), stepper)
    start = Rewind(sim)
    runs = []
    for _ in range(2):
        sim.advance_to(0.03)
        runs.append((sim.state(), sim.statistics))
        start.restore()
    assert sim.time == 0.0
    for one, two in zip(runs[0][0], runs[1][0], strict=True):
        np.testing.assert_array_equal(one, two)
    for key in ("base_steps", "particle_updates", "level_fractions"):
        assert runs[0][1][key] == runs[1][1][key]
    assert runs[1][1]["wall_seconds"] > 0.0


@pytest.mark.slow  # its parts have quick tests of their own
def test_a_comparison_from_the_command_line(tmp_path, capsys, quick_jobs, monkeypatch):
    args = ["compare", "dam_break_2d", *SIZE, "--steppers", "uniform,regional", "--courants", "0.4"]
    args += ["--cache-dir", str(tmp_path / "cache"), "--output-dir", str(tmp_path / "out")]
    main(args)
    shown = capsys.readouterr().out
    report = json.loads((tmp_path / "out" / "compare.json").read_text())
    runs = {run["label"]: run for run in report["variants"]}
    assert list(runs)[:2] == ["uniform λ=0.1333", "uniform λ=0.4"]
    assert runs["uniform λ=0.1333"]["role"] == "base step"
    assert sum(run["role"] == "largest stable" for run in runs.values()) == 1
    floor = report["scenes"][0]["floor"]["velocities"]
    assert (
        0.0 < floor < runs["uniform λ=0.1333"]["errors"]["velocities"] < runs["uniform λ=0.4"]["errors"]["velocities"]
    )
    regional = runs["regional λ=0.4"]
    assert regional["costs"]["pair_interactions"] > 5 * regional["costs"]["particle_updates"]
    assert len(regional["costs"]["wall_seconds_all"]) == 2
    assert regional["speedups"]["equal_step"] > 0.0
    assert report["scenes"][0]["parting_time"] == 0.02
    for word in ("Largest stable uniform step", "fastest at each error", "at equal error"):
        assert word in shown
    assert (tmp_path / "out" / "work_precision.png").read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "out" / "compare.csv").read_text().count("\n") == len(runs) + 1
    assert len(list((tmp_path / "cache").glob("*.npz"))) == 2

    # A second call neither overwrites nor runs what is there: the references come from the cache, all runs but one from `runs`.
    with pytest.raises(SystemExit) as stop:
        main(args)
    assert stop.value.code == 2
    assert "--resume" in capsys.readouterr().err
    lost = next(p for p in (tmp_path / "out" / "runs").iterdir() if "regional" in p.read_text()[:300])
    lost.unlink()
    made = []
    run = jobs.run
    monkeypatch.setattr("taichi_rts.compare.runner.run", lambda job: made.append(job) or run(job))
    monkeypatch.setattr("taichi_rts.compare.runner.find_largest_stable", None)
    main([*args, "--resume"])
    assert [job.stepper["name"] for job in made] == ["regional"]
    again = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert again["scenes"][0]["reference_cached"]
    for old, new in zip(report["variants"], again["variants"], strict=True):
        assert old["errors"] == new["errors"]


@pytest.mark.slow
def test_a_dask_client_is_an_executor(tmp_path):
    pytest.importorskip("distributed")
    scene = rts.load_scene("dam_break_2d", particles=30).replace(end_time=0.004)
    tasks = [Task("a run", 1.0, jobs.run, Job(scene.to_dict(), stepper_data(rts.Uniform()), samples=2))]
    found = {}
    with executors.dask("local") as client:
        collect(client, tasks, lambda text: None, found.__setitem__)
    assert found[0].survived
    assert found[0].trajectory.times == [0.0, 0.002, 0.004]
    assert found[0].costs["particle_updates"] > 0


def test_here_and_plain_futures_are_executors():
    class Plain:
        """Only what `concurrent.futures` promises of a future's result."""

        def submit(self, function, argument):
            return type("Future", (), {"result": lambda self: function(argument)})()

    for executor in (Here(), Plain()):
        found, begun = {}, []
        collect(executor, [Task(str(n), 1.0, abs, -n) for n in range(3)], begun.append, found.__setitem__)
        assert found == {0: 0, 1: 1, 2: 2}
        assert begun[:1] == ["0"]


def test_a_reference_that_does_not_survive_is_an_error(tmp_path, monkeypatch):
    dead = jobs.Outcome(None, {}, False, "energy +80 %", "cpu f64")
    monkeypatch.setattr("taichi_rts.compare.runner.run", lambda job: dead)
    monkeypatch.setattr(
        "taichi_rts.compare.runner.find_largest_stable",
        lambda job: {"stable": None, "unstable": 0.1, "reason": "energy"},
    )
    scene = rts.load_scene("dam_break_2d", particles=30)
    with pytest.raises(rts.Error, match="does not survive"):
        compare(scene, Settings(steppers=("uniform",), cache=tmp_path), executor=Here())
    assert references.load(tmp_path, "anything") is None
