import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.compare import folder, references
from taichi_rts.compare.jobs import Job
from taichi_rts.compare.references import job_key, reference_jobs, source_hash
from taichi_rts.compare.trajectory import Trajectory
from taichi_rts.solver.stepping.steppers import stepper_data, stepper_from

SCENE = rts.load_scene("dam_break_2d", particles=100)
JOB = Job(SCENE.to_dict(), stepper_data(rts.Uniform()))


def test_references_step_eight_times_finer_and_the_second_by_the_root_of_two_coarser():
    fine, coarse = reference_jobs(SCENE.to_dict(), 0.2, 40)
    assert fine.stepper["courant"] == pytest.approx(0.025)
    assert coarse.stepper["courant"] == pytest.approx(0.025 * 2**0.5)
    assert {fine.precision, coarse.precision} == {"f64"}


def test_the_key_depends_on_all_that_decides_the_run_and_on_nothing_else():
    key = job_key(JOB)
    assert len(key) == 64
    assert job_key(dataclasses.replace(JOB, scene=SCENE.replace(name="x", description="y").to_dict())) == key
    others = [
        dataclasses.replace(JOB, scene=SCENE.replace(end_time=2.0).to_dict()),
        dataclasses.replace(JOB, scene=SCENE.replace(spacing=0.09).to_dict()),
        dataclasses.replace(JOB, stepper=stepper_data(rts.Uniform(courant=0.3))),
        dataclasses.replace(JOB, stepper=stepper_data(rts.Regional())),
        dataclasses.replace(JOB, samples=20),
        dataclasses.replace(JOB, precision="f64"),
    ]
    assert len({key, job_key(JOB, "reference"), *map(job_key, others)}) == len(others) + 2


def test_the_sources_of_the_solver_count_and_others_do_not(tmp_path):
    beside = ("rendering/camera.py", "compare/plot.py", "benchmarks/rows.py", "terminal.py")
    for name in ("simulation.py", "solver/density.py", *beside):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("a = 1")
    before = source_hash(tmp_path)
    for name in beside:
        (tmp_path / name).write_text("a = 2")
    assert source_hash(tmp_path) == before
    (tmp_path / "solver/density.py").write_text("a = 2")
    assert source_hash(tmp_path) != before


def test_a_stored_reference_is_found_and_a_broken_one_is_not(tmp_path):
    run = Trajectory()
    state = {
        "positions": np.zeros((3, 2)),
        "velocities": np.ones((3, 2)),
        "densities": np.ones(3),
        "pressures": np.ones(3),
    }
    run.append(SimpleNamespace(time=0.0, energy=(0.0, 1.0, 2.0), **state))
    references.store(tmp_path, "key", run)
    assert references.load(tmp_path, "key").energies == [(0.0, 1.0, 2.0)]
    assert references.load(tmp_path, "other") is None
    path = tmp_path / "key.npz"
    path.write_bytes(path.read_bytes()[:100])
    assert references.load(tmp_path, "key") is None


def test_steppers_become_plain_data_and_back():
    for stepper in (rts.Uniform(0.3), rts.Regional(preset="paper", levels=4), rts.Asynchronous(stagger=3)):
        assert stepper_from(stepper_data(stepper)) == stepper


def test_a_folder_that_holds_a_comparison_is_kept(tmp_path):
    folder.prepare(tmp_path / "new")
    (tmp_path / "new" / "notes.txt").write_text("mine")
    (tmp_path / "new" / "compare.json").write_text("{}")
    with pytest.raises(rts.OutputError, match="--resume"):
        folder.prepare(tmp_path / "new")
    with pytest.raises(rts.OutputError, match="one of the two"):
        folder.prepare(tmp_path / "new", resume=True, overwrite=True)
    folder.prepare(tmp_path / "new", resume=True)
    assert (tmp_path / "new" / "compare.json").exists()
    folder.prepare(tmp_path / "new", overwrite=True)
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["notes.txt", "runs"]
    with pytest.raises(rts.OutputError, match="is a file"):
        folder.prepare(tmp_path / "new" / "notes.txt")
