"""Runs with a mesh that go on after the mesh was edited, or after all of the project has moved."""

import os
import sys
from pathlib import Path

import pytest

import taichi_rts as rts

sys.path.append(str(Path(__file__).parents[1]))
from programs import run

trimesh = pytest.importorskip("trimesh")

SCENE = """
spacing = 0.1
end_time = 0.02
domain = { lower = [0.0, 0.0, 0.0], upper = [0.8, 0.5, 0.3] }
[[fluids]]
lower = [0.0, 0.0, 0.0]
upper = [0.3, 0.3, 0.3]
[[obstacles]]
shape = "mesh"
file = "post.stl"
"""
RUN = ["run", "tank.toml", "--arch", "cpu", "--stepper", "uniform", "--no-frames", "--export-fps", "100"]
pytestmark = pytest.mark.usefixtures("quick_environment")


def write_post(folder, width=0.2):
    post = trimesh.creation.box((width, 0.5, 0.2))
    post.apply_translation((0.6, 0.25, 0.15))
    post.export(folder / "post.stl")


def program(*options, folder):
    return run(sys.executable, "-m", "taichi_rts", *options, folder=folder)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory, quick_environment):
    folder = tmp_path_factory.mktemp("stopped") / "project"
    folder.mkdir()
    (folder / "tank.toml").write_text(SCENE)
    write_post(folder)
    done = program(*RUN, "--checkpoint-every", "0.01", "--output-dir", "out/tank", folder=folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def project(stopped, tmp_path):
    """The same elsewhere, and not where it was."""
    moved = tmp_path / "elsewhere"
    os.rename(stopped, moved)
    yield moved
    if moved.exists():
        write_post(moved)
        os.rename(moved, stopped)


def go_on(folder, *options):
    return program(
        "run", "--resume", "out/tank", *options, "--end-time", "0.03", "--output-dir", "out/more", folder=folder
    )


def test_a_moved_project_goes_on(project):
    done = go_on(project, "--overwrite")
    assert done.returncode == 0, done.stderr
    assert f'"file": "{project}' in (project / "out" / "more" / "run.json").read_text()


def test_an_edited_mesh_is_refused_by_name(project):
    write_post(project, 0.2 + 1e-5)
    for options in ([], ["tank.toml"]):
        done = go_on(project, *options)
        assert done.returncode == 2
        assert f"obstacles.0: mesh file '{project / 'post.stl'}' has changed" in done.stderr
        assert "put the earlier file back, or start a new run" in done.stderr
        assert "Traceback" not in done.stderr


def test_a_mesh_that_is_gone_is_refused_by_name(project):
    (project / "post.stl").unlink()
    done = go_on(project)
    assert done.returncode == 2
    assert f"obstacles.0: mesh file '{project / 'post.stl'}' is gone" in done.stderr


def test_a_mesh_edited_after_the_scene_was_loaded(tmp_path):
    (tmp_path / "tank.toml").write_text(SCENE)
    write_post(tmp_path)
    scene = rts.load_scene(tmp_path / "tank.toml")
    other = rts.load_scene(tmp_path / "tank.toml")
    assert scene == other
    assert len(scene.obstacles[0].sha256) == 64
    write_post(tmp_path, 0.25)
    assert rts.load_scene(tmp_path / "tank.toml") != scene
    with pytest.raises(rts.SceneError, match=r"post\.stl' has changed"):
        scene.replace(end_time=1.0)
