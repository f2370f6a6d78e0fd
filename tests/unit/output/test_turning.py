"""Exports turned so that another tool's axis points up."""

import json

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.output.export import Exporter
from taichi_rts.output.panels import Panel
from taichi_rts.output.recorder import Recorder, Recording
from taichi_rts.output.turning import rotation_to, turned
from taichi_rts.particle_files.frame import ParticleFrame
from taichi_rts.rendering.painter import PictureOptions

TO_Z = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]


@pytest.mark.parametrize(
    ("up", "axis", "expected"),
    [
        ((0.0, 1.0, 0.0), "y", np.eye(3)),
        ((0.0, 1.0, 0.0), "z", TO_Z),  # Blender's: (x, y, z) -> (x, -z, y)
        ((0.0, 0.0, 1.0), "y", np.transpose(TO_Z)),
        ((0.0, -1.0, 0.0), "y", np.diag([1, -1, -1])),
    ],
)
def test_quarter_and_half_turns_are_exact(up, axis, expected):
    np.testing.assert_array_equal(rotation_to(up, axis), expected)


def test_any_direction_turns_up_rigidly():
    up = np.array([0.6, 0.48, -0.64])
    turn = rotation_to(tuple(up), "z")
    np.testing.assert_allclose(turn @ up, [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_vectors_turn_with_positions_and_numbers_do_not():
    x, v = np.array([[1.0, 2.0, 3.0]], np.float32), np.array([[4.0, 5.0, 6.0]], np.float32)
    frame = turned(ParticleFrame(x, {"velocity": v, "id": np.array([7])}, origin=(0.0, 1.0, 0.0)), np.array(TO_Z))
    np.testing.assert_array_equal(frame.positions, [[1, -3, 2]])
    np.testing.assert_array_equal(frame.attributes["velocity"], [[4, -6, 5]])
    np.testing.assert_array_equal(frame.attributes["id"], [7])
    assert frame.origin == (0.0, 0.0, 1.0)
    assert frame.positions.dtype == np.float32


def test_two_dimensions_stay_two_only_in_their_plane():
    frame = ParticleFrame(np.array([[1.0, 2.0]]))
    assert turned(frame, np.eye(3)).dim == 2
    np.testing.assert_array_equal(turned(frame, np.array(TO_Z)).positions, [[1, 0, 2]])


def test_a_recording_says_how_its_files_are_turned(taichi_cpu, unstarted, tmp_path):
    scene = rts.Scene(
        domain=rts.Box((0, 0, 0), (0.5, 0.4, 0.3)),
        fluids=[rts.Block((0, 0, 0), (0.4, 0.3, 0.2), velocity=(1, 2, 3))],
        spacing=0.1,
        gravity=(0, 0, -9.81),
        end_time=1.0,
    )
    recording = Recording(tmp_path / "out", 1.0, pictures=False, export=("npz",), up="y")
    with Recorder(scene, [Panel("", rts.Uniform())], PictureOptions(), recording) as recorder:
        recorder.exporter(next(iter(recorder.runs.values())))
        sim = next(iter(recorder.runs.values()))
        facts = json.loads(json.dumps(recorder.files()))
    assert facts["up"] == {"axis": "y", "rotation": np.transpose(TO_Z).tolist()}
    with np.load(tmp_path / "out" / "particles" / "000000.npz") as file:
        np.testing.assert_array_equal(file["position"], sim.positions()[:, [0, 2, 1]] * [1, 1, -1])
        np.testing.assert_array_equal(file["velocity"][0], [1, 3, -2])
    with pytest.raises(rts.OutputError, match="--up y turns what --export writes, and nothing is exported"):
        Recording(tmp_path, up="y").exporter(3)
    with pytest.raises(rts.OutputError, match=r"'x' is no axis .* choose y .* or z"):
        Exporter(tmp_path, up="x")
