import csv
import json

import imageio.v3 as imageio
import pytest

import taichi_rts as rts
from taichi_rts.commands.main import main
from taichi_rts.stability import command, suite
from taichi_rts.stability.cases import CASES, Case

pytestmark = pytest.mark.usefixtures("quick_environment")


def tiny(mach=0.0):
    block = rts.Block((0, 0), (0.4, 0.2), velocity=(0, -40 * mach))
    return rts.Scene(domain=rts.Box((0, 0), (0.4, 0.4)), fluids=[block], spacing=0.05, sound_speed=40.0, end_time=0.01)


FEW = (Case("tiny_pool", "16 particles at rest", tiny),)


@pytest.fixture
def taichi(start_taichi, quick):
    with start_taichi("cpu", "f32", **quick):
        yield


@pytest.fixture
def call(tmp_path, monkeypatch, taichi):
    monkeypatch.setattr(command, "CASES", FEW)
    monkeypatch.setattr(suite.Plan, "fresh", lambda plan: None)  # Taichi runs already
    monkeypatch.setattr(suite, "HIGHEST", 0.8)
    folder = tmp_path / "map"
    calls = []
    run = suite.run_cell

    def counted(plan, case, setting, demanded):
        calls.append((case.name, setting.name))
        return run(plan, case, setting, demanded)

    monkeypatch.setattr(suite, "run_cell", counted)

    def start(*args):
        calls.clear()
        main(["stability", "--steppers", "uniform", "--output-dir", str(folder), *args])
        return folder, list(calls)

    return start


def test_former_names_of_steppers_are_taken():
    assert [command.FORMER[name] for name in ("serna", "regional_paper", "adaptive_c")] == [
        "uniform",
        "paper",
        "uniform-c",
    ]
    assert set(command.FORMER.values()) < {setting.name for setting in suite.SETTINGS}


def test_a_map_is_written_and_resumed(call, capsys, monkeypatch):
    folder, calls = call("--tolerance", "1")
    assert calls == [("tiny_pool", "uniform")]
    out = capsys.readouterr().out
    assert "≥0.80" in out
    data = json.loads((folder / "stability.json").read_text())
    cell = data["cells"][0]
    assert (cell["case"], cell["setting"], cell["stable"], cell["unstable"]) == ("tiny_pool", "uniform", 0.8, None)
    assert cell["runs"] == [0.4, 0.8]
    assert cell["longest"] == pytest.approx(0.8)
    assert cell["outcome"]["survived"]
    assert data["complete"]
    rows = list(csv.DictReader((folder / "stability.csv").open()))
    assert [(row["case"], row["stable"]) for row in rows] == [("tiny_pool", "0.8")]
    assert imageio.imread(folder / "stability.png").std() > 10

    outcome = suite.Cell.load(cell).outcome
    monkeypatch.setattr(suite, "watch", lambda *args, **options: outcome)
    assert call("--tolerance", "1", "--resume") == (folder, [])
    (folder / "cells" / "tiny_pool--uniform.json").write_text("{")  # as after a stop in the middle of another program
    assert call("--tolerance", "1", "--resume", "--no-plot")[1] == [("tiny_pool", "uniform")]
    (folder / "notes.txt").write_text("mine")
    assert call("--tolerance", "1", "--overwrite", "--no-plot")[1] == [("tiny_pool", "uniform")]
    assert not (folder / "stability.png").exists()
    assert (folder / "notes.txt").exists()


@pytest.mark.slow
def test_quick_says_which_default_fails(call, capsys, monkeypatch):
    folder, _ = call("--quick")
    assert "ok" in capsys.readouterr().out
    monkeypatch.setattr(command, "CASES", (Case("fist", "Mach 1.9 on the floor", lambda: tiny(1.9)),))
    with pytest.raises(SystemExit) as stop:
        call("--quick", "--overwrite")
    assert stop.value.code == 1
    out = " ".join(capsys.readouterr().out.split())
    assert "FAIL" in out
    assert "default fails fist with uniform at 0.4: " in out
    assert not json.loads((folder / "stability.json").read_text())["cells"][0]["outcome"]["survived"]


def test_a_stop_keeps_what_is_done(call, monkeypatch):
    monkeypatch.setattr(command, "CASES", (*FEW, Case("stop", "Ctrl-C comes here", tiny)))
    run = suite.run_cell

    def interrupted(plan, case, setting, demanded):
        if case.name == "stop":
            raise KeyboardInterrupt
        return run(plan, case, setting, demanded)

    monkeypatch.setattr(suite, "run_cell", interrupted)
    with pytest.raises(SystemExit) as stop:
        call("--quick")
    assert stop.value.code == 130
    monkeypatch.setattr(suite, "run_cell", run)
    folder, _ = call("--quick", "--resume", "--cases", "tiny_pool")
    data = json.loads((folder / "stability.json").read_text())
    assert data["complete"]
    assert len(data["cells"]) == 1


def test_an_earlier_map_is_kept(tmp_path, capsys):
    (tmp_path / "stability.json").write_text("{}")
    with pytest.raises(SystemExit) as stop:
        main(["stability", "--output-dir", str(tmp_path)])
    assert stop.value.code == 2
    assert "--resume or --overwrite" in capsys.readouterr().err
    assert (tmp_path / "stability.json").read_text() == "{}"


def test_every_case_is_a_small_scene():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)
    for case in CASES:
        scene = case.scene
        assert scene.name == case.name
        assert sum(fluid.volume for fluid in scene.fluids) / scene.spacing**scene.dim <= 600


@pytest.mark.slow
def test_several_workers_share_the_cases(call):
    folder, _ = call("--quick", "--workers", "2")
    cells = json.loads((folder / "stability.json").read_text())["cells"]
    assert [(cell["case"], cell["outcome"]["survived"]) for cell in cells] == [("tiny_pool", True)]
