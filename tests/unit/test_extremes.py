"""What says that a run is not to be trusted, and what a user is told about it."""

import sys
import warnings
from types import SimpleNamespace

import pytest
from programs import run

import taichi_rts as rts
from taichi_rts.readings.extremes import Extremes
from taichi_rts.scene.checks.size import warn_of_size


def extremes(mach, dense, sound=None):
    found = Extremes({"run": SimpleNamespace(sound=sound, medium=SimpleNamespace(sound_speed=5.0))})
    found.take([[mach, 1.2, dense]])
    return found


def test_weakly_compressible_flow_is_not_red():
    found = extremes(0.3, 0.25)
    assert found.is_weakly_compressible("run")
    assert found.facts("run") == [
        ("largest local Mach number", "0.300"),
        ("largest density", "1.200 of rest; 25.00% of the particles above 103% at worst"),
    ]


def test_what_is_not_is_red_with_the_sound_speed_to_use():
    found = extremes(1.04, 0.88)
    assert not found.is_weakly_compressible("run")
    (_, mach), (_, density) = found.facts("run")
    remedy = "use --sound-speed 52 (now 5 m/s), ten times the largest speed"
    assert mach == f"[bold red]1.040[/], above 0.3: too fast for the sound speed; {remedy}"
    assert density.startswith(
        "[bold red]1.200 of rest; 88.00% of the particles above 103% at worst[/]: too much compressed"
    )
    assert "give --sound-speed a number" in extremes(0.31, 0.0, sound=object()).facts("run")[0][1]
    assert not extremes(0.1, 0.26).is_weakly_compressible("run")


def test_a_domain_in_millimetres_is_warned_of():
    def scene(factor, **options):
        fluid = rts.Block((0, 0), (300 * factor, 400 * factor))
        return rts.Scene(
            domain=rts.Box((0, 0), (1000 * factor, 800 * factor)), fluids=[fluid], spacing=20 * factor, **options
        )

    with pytest.warns(UserWarning, match=r"is 1000 m across.* divide all its lengths by 1000 \(that is 1 m\)"):
        warn_of_size(scene(1.0, gravity=(0, -9.81)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_size(scene(0.001, gravity=(0, -9.81)))
        warn_of_size(scene(1.0, gravity=(0, 0), sound_speed=10.0))
        for name in rts.scene_names():
            warn_of_size(rts.load_scene(name))


@pytest.mark.slow
@pytest.mark.usefixtures("quick_environment")
def test_strict_runs_exit_with_3(tmp_path):
    command = [
        "run",
        "dam_break_2d",
        "--spacing",
        "0.1",
        "--end-time",
        "0.6",
        "--no-frames",
        "--arch",
        "cpu",
        "--export-fps",
        "20",
    ]
    command += ["--stepper", "uniform", "--overwrite", "--output-dir", "out"]

    def exit_code(*options):
        done = run(sys.executable, "-m", "taichi_rts", *command, *options, folder=tmp_path)
        return done.returncode, " ".join(done.stdout.split()), done.stderr

    code, said, error = exit_code("--sound-speed", "5", "--strict")
    assert code == 3, error
    assert "use --sound-speed" in said
    assert error == "taichi-rts: --strict: the table marks uniform steps red\n"
    code, said, error = exit_code("--sound-speed", "5")
    assert (code, error) == (0, "")
    assert "use --sound-speed" in said
    code, said, error = exit_code("--strict")
    assert (code, error) == (0, "")
    assert "use --sound-speed" not in said
