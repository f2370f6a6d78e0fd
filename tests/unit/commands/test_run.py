import dataclasses
import hashlib
import json
import subprocess
import sys

import imageio.v3 as imageio
import pytest

import taichi_rts as rts
from taichi_rts.commands.main import main, parse_demo
from taichi_rts.commands.options import StepperOptions
from taichi_rts.commands.run import Run
from taichi_rts.output.options import replaced
from taichi_rts.output.panels import LAYOUTS, Panel

pytestmark = pytest.mark.usefixtures("quick_environment")

SMALL = [
    "--arch",
    "cpu",
    "--spacing",
    "0.1",
    "--end-time",
    "0.1",
    "--export-fps",
    "20",
    "--width",
    "320",
    "--height",
    "180",
]


def run(*args):
    command = [sys.executable, "-m", "taichi_rts", *args]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def two_runs(tmp_path_factory):
    folders = [tmp_path_factory.mktemp("run") / name for name in ("one", "two")]
    results = [run("run", "double_dam_break_2d", "--preset", "paper", *SMALL, "--output-dir", str(f)) for f in folders]
    assert all(result.returncode == 0 for result in results), results[0].stderr
    return folders, results


def test_run_writes_frames_and_facts(two_runs):
    (folder, _), (result, _) = two_runs
    frames = sorted((folder / "frames").iterdir())
    assert [frame.name for frame in frames] == ["000000.png", "000001.png", "000002.png"]
    assert imageio.imread(frames[0]).shape == (180, 320, 3)
    facts = json.loads((folder / "run.json").read_text())
    for key in ("scene", "stepper", "arch", "particles", "end_time", "base_steps", "particle_updates", "wall_seconds"):
        assert key in facts
    assert facts["end_time"] == 0.1
    assert facts["filling"]["wanted"] == facts["filling"]["filled"] == pytest.approx(1.2)
    assert facts["filling"]["rounded"] == []
    assert facts["active_fraction"] == pytest.approx(
        facts["particle_updates"] / facts["particles"] / facts["base_steps"]
    )
    assert sum(facts["level_fractions"]) == pytest.approx(1.0)
    assert "active fraction" in result.stdout
    assert "energy dissipated" in result.stdout


def test_the_same_command_gives_the_same_bits(two_runs):
    folders, _ = two_runs
    facts = [json.loads((folder / "run.json").read_text()) for folder in folders]
    for fact in facts:
        del fact["wall_seconds"]
    assert facts[0] == facts[1]
    hashes = [
        [hashlib.sha256(frame.read_bytes()).hexdigest() for frame in sorted((folder / "frames").iterdir())]
        for folder in folders
    ]
    assert hashes[0] == hashes[1]
    assert len(set(hashes[0])) == 3


def test_a_window_takes_what_demos_set_and_what_it_can_obey(monkeypatch):
    seen = []
    monkeypatch.setattr("taichi_rts.window.live.watch", lambda *args: seen.append(args))
    parse("--gui", "--colour-by", "speed", "--width", "640", "--palette", "paper", "--azimuth", "10")()
    _, stepper, options, _, _ = seen[0]
    assert stepper == rts.Regional(preset="paper")
    assert (options.colour_by, options.width, options.palette, options.azimuth) == ("speed", 640, "paper", 10.0)


def parse(*args):
    return parse_demo(replaced(Run(), {"scene": "double_dam_break", "preset": "paper", "export_fps": 20.0}), list(args))


def test_a_demos_preset_holds_for_its_own_stepper_only():
    assert parse().stepping.make() == rts.Regional(preset="paper")
    assert parse("--levels", "4").stepping.make() == rts.Regional(preset="paper", levels=4)
    other = parse("--stepper", "asynchronous", "--levels", "16", "--courant", "0.8")
    assert other.stepping.make() == rts.Asynchronous(levels=16, courant=0.8)
    assert other.files.export_fps == 20.0
    assert parse("--stepper", "uniform").stepping.make() == rts.Uniform()
    with pytest.raises(rts.StepperError, match="--preset does not belong to the asynchronous stepper"):
        parse("--stepper", "asynchronous", "--preset", "paper").stepping.make()


def test_every_option_of_the_asynchronous_stepper_can_be_given():
    args = ["--steps", "integers", "--limiter", "False", "--stagger", "7", "--levels", "6", "--lambda-f", "0.1"]
    args += ["--courant", "0.8", "--inactive-density", "stale"]
    wanted = rts.Asynchronous(0.8, 6, "integers", 0.1, limiter=False, inactive_density="stale", stagger=7)
    assert parse("--stepper", "asynchronous", *args).stepping.make() == wanted
    assert parse("--limiter", "True").stepping.make() == rts.Regional(preset="paper", limiter=True)
    assert {field.name for field in dataclasses.fields(rts.Asynchronous)} <= set(vars(StepperOptions()))


def test_panels_have_their_own_steppers():
    def panels(scene, *args):
        run = parse(*args)
        return run.make_panels(scene, run.stepping.make())

    assert panels("dam_break", "--panels", "steppers") == LAYOUTS["steppers"]
    assert [panel.stepper.name for panel in LAYOUTS["steppers"]] == ["uniform", "regional", "asynchronous"]
    assert panels("serna_ablation", "--stepper", "uniform") == [Panel("", rts.Uniform())]
    assert Run().make_panels("serna_ablation", rts.Regional()) == LAYOUTS["ablation"]
    with pytest.raises(rts.StepperError, match="leave out --preset"):
        panels("dam_break", "--panels", "steppers", "--preset", "paper")


@pytest.mark.slow
def test_a_panel_for_each_stepper_at_the_same_time(tmp_path):
    size = ["--spacing", "0.05", "--end-time", "0.02", "--export-fps", "50", "--width", "320", "--height", "360"]
    result = run(
        "run", "dam_break_2d", "--panels", "steppers", "--arch", "cpu", *size, "--output-dir", str(tmp_path / "out")
    )
    assert result.returncode == 0, result.stderr
    facts = json.loads((tmp_path / "out" / "run.json").read_text())
    assert [each["stepper"]["name"] for each in facts["panels"]] == ["uniform", "regional", "asynchronous"]
    assert {each["end_time"] for each in facts["panels"]} == {0.02}
    last = facts["panels"][2]
    assert last["base_steps"] == pytest.approx(0.02 / last["base_step"], abs=1)
    assert last["passes"] > 0
    assert last["cells_per_pass"]["max"] >= last["cells_per_pass"]["min"] >= 1
    height, width, _ = imageio.imread(tmp_path / "out" / "frames" / "000001.png").shape
    assert width == 320
    assert height > 3 * 180
    assert "cells in a pass" in result.stdout


def test_a_missing_arch_never_falls_back(tmp_path):
    from taichi_rts.device import backend

    if backend.available()["cuda"] == "available":
        pytest.skip("this machine has CUDA")
    result = run("run", "dam_break", *SMALL[2:], "--arch", "cuda", "--output-dir", str(tmp_path / "out"))
    assert result.returncode == 2
    assert "cuda" in result.stderr
    assert "--arch cpu" in result.stderr
    assert not (tmp_path / "out").exists()


def test_scenes_and_info_list_what_there_is(capsys):
    main(["scenes"])
    assert "martin_moyce" in capsys.readouterr().out
    main(["info"])
    assert "arch cpu" in capsys.readouterr().out
