"""Runs that really blow up: they stop within a frame, say why, and keep what tells it."""

import json

import numpy as np
import pytest
from trial import attempt

import taichi_rts as rts
from taichi_rts.output.blow_up import BlowUpGuard
from taichi_rts.output.panels import Panel
from taichi_rts.output.recorder import Recorder, Recording
from taichi_rts.readings.diagnosis import diagnose
from taichi_rts.rendering.painter import PictureOptions

pytestmark = pytest.mark.usefixtures("quick_environment")

SCENE = (
    "dam_break_2d",
    "--spacing",
    "0.1",
    "--arch",
    "cpu",
    "--precision",
    "f64",
    "--end-time",
    "1",
    "--export-fps",
    "40",
)
PICTURE = ("--width", "160", "--height", "90", "--output-dir", "out")


@pytest.mark.slow
def test_a_courant_far_too_large(tmp_path):
    trial = attempt(tmp_path, "run", *SCENE, *PICTURE, "--stepper", "uniform", "--courant", "2")
    assert trial.code == 2
    assert "Traceback" not in trial.said
    for words in (
        "blown up: at t = ",
        "particle ",
        "level 1",
        "Its block: ",
        "which allow steps of 0.4 r/(c_s + |v|)",
        "Likely",
    ):
        assert words in trial.said
    assert "a smaller courant (the longest step is 2 r/c_s now)" in trial.said
    out = tmp_path / "out"
    frames = sorted(path.name for path in (out / "frames").iterdir())
    facts = json.loads((out / "blow_up" / "diagnosis.json").read_text())
    assert 1 <= len(frames) < 40
    assert len(frames) == round(facts["time"] * 40)  # the frame at which it was noticed is not written
    assert not (out / "run.json").exists()
    before, after = (rts.read_particles(out / "blow_up" / f"{name}.vtu") for name in ("before", "after"))
    assert before.time == pytest.approx(facts["time"] - 1 / 40)
    assert after.time == pytest.approx(facts["time"])
    speeds = [np.linalg.norm(frame.attributes["velocity"], axis=1).max() for frame in (before, after)]
    assert speeds[1] > 2 * speeds[0]
    again = attempt(tmp_path, "run", *SCENE, *PICTURE, "--stepper", "uniform")
    assert "already holds a run" in again.said


@pytest.mark.slow
def test_a_number_that_is_none(tmp_path, start_taichi, quick):
    scene = rts.load_scene("dam_break_2d", spacing=0.1, end_time=0.2)
    stepper = rts.Uniform()
    with start_taichi("cpu", "f64", **quick):
        options = PictureOptions(width=160, height=90)
        with Recorder(scene, [Panel("", stepper)], options, Recording(tmp_path, fps=50)) as recorder:
            sim = recorder.runs[stepper]

            def spoil(time):
                if time == 0.04:
                    sim.particles.v[7] = (np.nan, 0.0)

            with pytest.raises(rts.SimulationDivergedError, match=r"at t = 0\.06 s particle .* is not a finite number"):
                recorder.record(0.2, spoil)
        assert len(list((tmp_path / "frames").iterdir())) == 3
        before = rts.read_particles(tmp_path / "blow_up" / "before.vtu")
        assert before.time == 0.04
        assert np.isfinite(before.attributes["velocity"]).all()
        after = rts.read_particles(tmp_path / "blow_up" / "after.vtu")
        assert not np.isfinite(after.attributes["velocity"]).all()

        other = rts.Simulation(scene, stepper)
        guard = BlowUpGuard({"other": other, "broken": sim}, tmp_path)
        guard.look()
        assert list(guard.found) == ["broken"]  # of several, one that is whole goes on
        assert diagnose(other) is None
        place = other.particles.identity.to_numpy().tolist().index(3)
        other.particles.rho[place] = 2.5 * scene.rest_density
        assert "density 2.5 of rest is not between 0.02 and 2" in diagnose(other).exceeded
        with pytest.raises(
            rts.SimulationDivergedError, match=r"at t = 0 s particle 3 .* density 2\.5 of rest is not between"
        ):
            other.check()
        with pytest.raises(rts.SimulationDivergedError, match="blown up"):
            guard.look()


def test_a_script_is_told_at_the_frame(start_taichi, quick):
    """Speeds that are limited stay finite, so `advance_to` goes on; `run` ends at the first frame that has some."""
    scene, frames = rts.load_scene("dam_break_2d", spacing=0.1), []
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(scene, rts.Uniform(courant=2.0))
        with pytest.raises(rts.SimulationDivergedError, match=r"blown up: at t = .* Remedy: a smaller courant"):
            sim.run(1.0, lambda sim: frames.append(sim.time), fps=40)
        assert sim.statistics["runaways"] > 0
        assert frames == [number / 40 for number in range(len(frames))]
        assert sim.time == len(frames) / 40 < 1.0
