"""Every row of bad_checkpoints is refused as a whole, and a simulation that it was to be put into is as it was."""

import numpy as np
import pytest
from bad_checkpoints import ROWS, lie, write_changed
from trial import attempt

import taichi_rts as rts
from taichi_rts.output import checkpoint, recorder
from taichi_rts.output.panels import Panel
from taichi_rts.output.recorder import Recorder, Recording
from taichi_rts.rendering.painter import PictureOptions


class StartedError(Exception):
    """A run has gone on that should not."""


@pytest.fixture(scope="module")
def made(tmp_path_factory, start_taichi, quick):
    """A checkpoint of a small run, and the simulation."""
    folder = tmp_path_factory.mktemp("run")
    scene, stepper = rts.load_scene("dam_break_2d", spacing=0.1, end_time=0.04), rts.Uniform()
    with start_taichi("cpu", "f32", **quick):
        wanted = Recording(
            folder / "out",
            fps=50,
            checkpoint_every=0.02,
            pictures=False,
            command={"stepper": "uniform", "frames": False, "export_fps": 50.0},
        )
        with Recorder(scene, [Panel("", stepper)], PictureOptions(), wanted) as made:
            made.record(0.02)
            yield next((folder / "out" / "checkpoints").iterdir()), made.runs[stepper]


@pytest.fixture
def never_starts(monkeypatch, made):
    """Nothing is compiled again: a checkpoint is put into the simulation that wrote it."""

    def stop(*_args, **_options):
        raise StartedError

    monkeypatch.setattr(checkpoint, "Simulation", lambda *_args, **_options: made[1])
    monkeypatch.setattr(recorder, "Series", stop)
    monkeypatch.setattr("taichi_rts.commands.main.rts.init", lambda *_args, **_options: made[1].backend)


@pytest.mark.usefixtures("never_starts")
@pytest.mark.parametrize(("what", "change"), ROWS, ids=[what for what, _ in ROWS])
def test_rows(what, change, made, tmp_path):
    source, sim = made
    before = sim.state()
    write_changed(source, tmp_path / "changed.npz", change)
    trial = attempt(tmp_path, "run", "--resume", "changed.npz", "--output-dir", "out")
    assert not trial.faults(("changed.npz",)), trial.said
    assert all(np.array_equal(a, b) for a, b in zip(before, sim.state(), strict=True))


@pytest.mark.usefixtures("never_starts")
def test_a_claim_of_1e12_particles_takes_no_memory(made, tmp_path):
    lie(made[0], tmp_path / "changed.npz")
    trial = attempt(tmp_path, "run", "--resume", "changed.npz", "--output-dir", "out")
    assert not trial.faults(("changed.npz", "no array 0/solver.particles.x that can be read")), trial.said


@pytest.mark.usefixtures("never_starts")
def test_an_unchanged_one_goes_on(made, tmp_path):
    write_changed(made[0], tmp_path / "changed.npz", lambda header, arrays: None)
    trial = attempt(tmp_path, "run", "--resume", "changed.npz", "--output-dir", "out")
    assert "StartedError" in trial.said
