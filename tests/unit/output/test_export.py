import json
import subprocess
import sys

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.commands.main import main
from taichi_rts.output.export import ATTRIBUTES, Exporter, capture
from taichi_rts.output.panels import Panel
from taichi_rts.output.recorder import Recorder, Recording
from taichi_rts.rendering.painter import PictureOptions

SCENE = rts.Scene(
    domain=rts.Box((0, 0), (1, 1)),
    fluids=[rts.Block((0, 0), (0.5, 0.5))],
    spacing=0.05,
    probes=[rts.Probe((0.2, 0.1), "floor")],
    gauges=[rts.Gauge((0.2, 0.0))],
    end_time=0.1,
)


@pytest.fixture(scope="module")
def recorded(start_taichi, quick, tmp_path_factory):
    """A run whose particles go to all formats that hold two dimensions, and what it ended with."""
    folder = tmp_path_factory.mktemp("run") / "out"
    formats = ("vtu", "ply", "npz", "bgeo")
    recording = Recording(folder, 20.0, pictures=False, export=formats, attributes=tuple(ATTRIBUTES))
    with start_taichi("cpu", "f32", **quick):
        recorder = Recorder(SCENE, [Panel("", rts.Asynchronous())], PictureOptions(), recording)
        facts = recorder.record(0.1)
        sim = recorder.runs[rts.Asynchronous()]
        end = {"position": sim.positions(), "velocity": sim.velocities(), "pressure": sim.pressures()}
        end |= {"cell_time": sim.cell_times(), "step": sim.steps(), "level": sim.levels()}
        return folder, facts, end


def test_every_format_has_a_file_for_each_frame(recorded):
    folder, facts, _ = recorded
    names = [f"{k:06d}{suffix}" for k in range(3) for suffix in (".bgeo", ".npz", ".ply", ".vtu")]
    assert sorted(path.name for path in (folder / "particles").iterdir()) == sorted([*names, "particles.pvd"])
    assert not (folder / "frames").exists()
    assert facts["files"]["npz"] == "particles/NNNNNN.npz"
    assert facts["files"]["times"] == [0.0, 0.05, 0.1]
    assert "frames" not in facts["files"]
    assert json.loads((folder / "run.json").read_text())["files"] == facts["files"]


def test_numpy_reads_what_the_simulation_ended_with(recorded):
    folder, _, end = recorded
    with np.load(folder / "particles" / "000002.npz", allow_pickle=False) as file:
        assert set(file.files) == {"position", "time", "spacing", *ATTRIBUTES}
        assert float(file["time"]) == 0.1
        assert float(file["spacing"]) == 0.05
        np.testing.assert_array_equal(file["id"], np.arange(100))
        for name, values in end.items():
            np.testing.assert_array_equal(file[name], values.astype(file[name].dtype), err_msg=name)
        assert (file["sound_speed"] == np.float32(SCENE.wave_speed)).all()
        ahead = file["cell_time"] - 0.1
        assert -file["step"].max() < ahead.min() < 0.0 < file["step"].min()  # every cell is within a step of the frame
        assert ahead.max() <= file["step"].max()


def test_paraview_finds_the_frames_with_their_times(recorded):
    pyvista = pytest.importorskip("pyvista")
    folder, _, end = recorded
    reader = pyvista.get_reader(folder / "particles" / "particles.pvd")
    assert reader.time_values == [0.0, 0.05, 0.1]
    reader.set_active_time_value(0.1)
    cloud = reader.read()[0]
    np.testing.assert_array_equal(cloud.points[:, :2], end["position"])
    np.testing.assert_array_equal(cloud.point_data["velocity"][:, :2], end["velocity"])


def test_the_series_has_a_row_for_each_frame(recorded):
    folder, _, end = recorded
    rows = np.genfromtxt(folder / "series.csv", delimiter=",", names=True, deletechars="")
    np.testing.assert_allclose(rows["time"], [0.0, 0.05, 0.1])
    assert rows["centre_y"][2] == pytest.approx(end["position"][:, 1].mean(), rel=1e-6)
    assert rows["max_speed"][2] == pytest.approx(np.linalg.norm(end["velocity"], axis=1).max(), rel=1e-6)
    levels = [name for name in rows.dtype.names if name.startswith("level_")]
    assert levels == ["level_1", "level_2", "level_4", "level_8"]
    np.testing.assert_allclose(sum(rows[name] for name in levels), 1.0)
    assert rows["height_1"][0] == pytest.approx(0.5, abs=0.005)
    assert rows["height_1"][2] < 0.49
    assert rows["pressure_floor"][1] > 500.0
    assert rows["particle_updates"][0] == 0.0 < rows["particle_updates"][1] < rows["particle_updates"][2]


def test_what_cannot_be_written_is_said_before_anything_is(tmp_path):
    with pytest.raises(rts.OutputError, match=r"'vtk' is no format; choose from vtu, ply, .*; did you mean 'vtu'"):
        Exporter(tmp_path, ["vtk"])
    with pytest.raises(rts.OutputError, match="'csv' is no format"):
        Exporter(tmp_path, ["csv"])
    with pytest.raises(rts.OutputError, match="'speeed' is no attribute; choose from id, velocity, density"):
        Exporter(tmp_path, ["vtu"], ["speeed"])


def test_bad_options_are_one_message(tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(
            ["run", "dam_break_2d", "--arch", "cpu", "--gui", "--export", "ply", "--output-dir", str(tmp_path / "out")]
        )
    assert stop.value.code == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "--gui" in said
    assert "--export" in said
    assert not (tmp_path / "out").exists()


def test_core_imports_no_extra():
    extras = {"h5py", "pysplashsurf", "meshio", "vtk", "matplotlib"}
    code = f"import sys, taichi_rts, taichi_rts.commands.main; print(sorted({extras} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.strip().endswith("[]")


def test_frames_of_a_run_in_python(start_taichi, quick, tmp_path):
    with start_taichi("cpu", "f32", **quick):
        sim = rts.Simulation(SCENE, rts.Asynchronous())
        seen = []
        sim.run(0.05, on_frame=[lambda sim: seen.append(sim.time), rts.Exporter(tmp_path, ["npz"], ["id"])], fps=40)
        assert seen == [0.0, 0.025, 0.05]
        sim.run(0.06, on_frame=lambda sim: seen.append(sim.time), fps=40)
        assert seen[3:] == [0.06]
        assert repr(sim) == "Simulation('scene', Asynchronous, 100 particles, t = 0.06 s)"
        picture = sim.show(width=96, height=64, colour_by="speed")
        assert picture.size == (96, 64)
        assert np.ptp(np.asarray(picture), axis=(0, 1)).max() > 50
        frame = capture(sim, ["velocity"])
    assert sorted(path.name for path in (tmp_path / "particles").iterdir()) == [
        "000000.npz",
        "000001.npz",
        "000002.npz",
    ]
    assert list(frame.attributes) == ["velocity"]
    assert frame.time == 0.06
