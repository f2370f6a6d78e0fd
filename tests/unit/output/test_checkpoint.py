"""A run that goes on from a checkpoint has the bits of one that never stopped; a file that is not whole is refused."""

import json
import random
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.assembly.inventory import State, is_part, is_plain, transient_names
from taichi_rts.device.backend import ti
from taichi_rts.files.archive import open_archive, write_archive
from taichi_rts.output import checkpoint
from taichi_rts.output.checkpoint import Checkpoint, differences

sys.path.append(str(Path(__file__).parents[3] / "studies"))
from faults_step import SCENE, STEPPERS

STILL = rts.Scene(
    domain=rts.Box((0, 0), (1, 1)), fluids=[rts.Block((0, 0), (1, 0.3))], spacing=0.1, density="continuity"
)
TIMELESS = {"wall_seconds", "overhead_fraction"}
EARLY, LATE = 0.0213, 0.05


def seen(sim):
    """All that a simulation shows of itself, as bytes."""
    facts = {key: value for key, value in sim.statistics.items() if key not in TIMELESS}
    facts |= {"time": sim.time, "energy": sim.energy(), "count": sim.count}
    if sim.keeps_work:
        facts["work"] = sim.work()
    return [array.tobytes() for array in sim.state()] + [json.dumps(facts)]


def stop_in_the_middle(sim, time):
    """Stop as a signal does, between two steps: with `Asynchronous` where cells have different times."""
    sim.advance_to(time)
    asked = iter([False, False, True])
    sim.stop_asked = lambda: next(asked)
    with pytest.raises(rts.errors.Interrupted):
        sim.advance_to(2 * time)
    sim.stop_asked = lambda: False


@pytest.mark.slow
@pytest.mark.parametrize(  # all six: python studies/faults.py
    ("name", "precision"),
    [
        ("uniform", "f32"),
        ("regional", "f64"),
        ("asynchronous", "f32"),
    ],
)
def test_the_same_bits_as_without_a_stop(start_taichi, quick, tmp_path, name, precision):
    stepper = STEPPERS[name]
    path = tmp_path / "checkpoint.npz"
    with start_taichi("cpu", precision, **quick):
        sim = rts.Simulation(SCENE, stepper, debug=name == "regional")
        stop_in_the_middle(sim, EARLY)
        if stepper.name == "asynchronous":
            assert sim.leads().max() > 0.0
            assert sim.timeline.now < sim.schedule.cycle_end
        assert sim.inflows.done[0] > 0
        before = everything(sim)
        rts.save_checkpoint(sim, path)
        sim.advance_to(LATE)
        uninterrupted = seen(sim)
        with open_archive(path) as archive:  # into a state that is none it should have
            Checkpoint(archive).restore(sim)
        after = everything(sim)
        assert before.keys() == after.keys()
        assert not [name for name in before if before[name] != after[name]]
        sim.advance_to(LATE)
        assert seen(sim) == uninterrupted


def everything(sim):
    """Every field and plain value, as bytes."""
    state = State(sim)
    fields = {name: field.to_numpy().tobytes() for name, field in state.fields.items()}
    return fields | {f"{path}.{name}": repr(value) for path, name, value in state.values()}


def test_a_new_simulation_takes_it_up_and_nothing_is_left_out(start_taichi, quick, tmp_path):
    path = tmp_path / "checkpoint.npz"
    stepper = rts.Regional(levels=3)
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(STILL, stepper)
        assert not unknown(sim)
        stop_in_the_middle(sim, 0.02)
        rts.save_checkpoint(sim, path)
        sim.advance_to(0.04)
        before = seen(sim)
    with start_taichi("cpu", "f64", **quick):
        other = rts.load_checkpoint(path)
        assert (other.scene, other.stepper) == (STILL, stepper)
        other.advance_to(0.04)
        assert seen(other) == before
        rts.save_checkpoint(other, tmp_path / "one.npz")
        with open_archive(tmp_path / "one.npz") as archive:
            Checkpoint(archive).restore(other)
        rts.save_checkpoint(other, tmp_path / "two.npz")
        assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
        with pytest.raises(rts.CheckpointError, match="has no run 1, only 1 of them; use 0 to 0"):
            rts.load_checkpoint(path, run=1)
        for what, there in (("format", checkpoint.FORMAT + 1), ("version", "9.9")):
            change_header(path, tmp_path / "changed.npz", **{what: there})
            with pytest.raises(rts.CheckpointError, match=f"{what} {there!r}.* with {what} "):
                rts.load_checkpoint(tmp_path / "changed.npz")
        change_header(path, tmp_path / "changed.npz", precision="f32")
        with pytest.raises(
            rts.CheckpointError, match=r'precision f32, and f64 is in use; call init\(precision="f32"\)'
        ):
            rts.load_checkpoint(tmp_path / "changed.npz")


def unknown(sim):
    """Attributes of a simulation's parts that are neither fields, plain, nor parts, nor code: state may hide there."""
    state, found, code = State(sim), [], ("function", "method", "Func", "MatrixType", "DataTypeCxx", "Kernel")
    transient = {id(vars(part)): transient_names(type(part)) for part in state.parts}
    for path, owner in state.owners.items():
        for name, value in owner.items():
            if name in transient[id(owner)]:  # said to be no state
                continue
            values = value if isinstance(value, (list, tuple)) else [value]
            if isinstance(value, dict):
                values = list(value.values())
            for each in values:
                known = is_plain(each) or is_part(each) or isinstance(each, ti.Field) or type(each).__name__ in code
                if not known and not (isinstance(each, tuple) and all(map(is_part, each))):
                    found.append((path, name, type(each)))
    return found


def change_header(path, to, **changes):
    with open_archive(path) as archive:
        names = [name.removesuffix(".npy") for name in archive.zip.namelist() if name.endswith(".npy")]
        write_archive(to, archive.header | changes, {name: archive.array(name) for name in names})


def test_what_a_class_calls_transient_is_known_to_its_heirs():
    from taichi_rts.solver.physics.moving_walls import MovingFace
    from taichi_rts.solver.stepping.passes import AsynchronousSchedule

    assert {"due", "reads_are_slow"} <= transient_names(AsynchronousSchedule)
    assert {"x", "shift"} <= transient_names(MovingFace)


# -- the file -------------------------------------------------------------------------------------------------------


@pytest.fixture
def whole(tmp_path):
    path = tmp_path / "whole.npz"
    write_archive(path, {"a": [1, 2]}, {"x": np.arange(12.0).reshape(3, 4), "n": np.int32(3)})
    return path


def test_an_archive_is_an_npz(whole):
    with open_archive(whole) as archive:
        assert archive.header == {"a": [1, 2]}
        assert archive.array("x", np.float64, (3, 4)).tolist() == np.arange(12.0).reshape(3, 4).tolist()
        with pytest.raises(rts.CheckpointError, match=r"has x of float64 \(3, 4\) where float32 \(3,\) is needed"):
            archive.array("x", np.float32, (3,))
        with pytest.raises(rts.CheckpointError, match="has no array y"):
            archive.array("y")
    assert np.load(whole, allow_pickle=False)["x"].shape == (3, 4)
    assert [path.name for path in whole.parent.iterdir()] == ["whole.npz"]


def test_every_bit_counts(whole):
    data, chance = whole.read_bytes(), random.Random(7)
    for place in [*chance.sample(range(len(data)), 200), 0, len(data) - 1]:
        changed = bytearray(data)
        changed[place] ^= 1 << chance.randrange(8)
        whole.write_bytes(changed)
        with pytest.raises(rts.CheckpointError, match=r"damaged|another file"), open_archive(whole):
            pass
    for length in [0, 1, len(data) // 2, len(data) - 1]:
        whole.write_bytes(data[:length])
        with pytest.raises(rts.CheckpointError, match=r"too short|cut short"), open_archive(whole):
            pass


def test_foreign_files_are_refused(tmp_path):
    np.savez(tmp_path / "other.npz", x=np.arange(300))
    (tmp_path / "text").write_text("checkpoint" * 40)
    for name in ("other.npz", "text"):
        with pytest.raises(rts.CheckpointError, match="another file"):
            rts.load_checkpoint(tmp_path / name)
    with pytest.raises(rts.CheckpointError, match="No such file or directory; check the path"):
        rts.load_checkpoint(tmp_path / "missing.npz")
    write_archive(tmp_path / "empty.npz", {}, {})
    with pytest.raises(rts.CheckpointError, match="has format None"):
        rts.load_checkpoint(tmp_path / "empty.npz")
    now = {"format": checkpoint.FORMAT, "version": rts.__version__}
    write_archive(tmp_path / "empty.npz", now, {})
    with pytest.raises(rts.CheckpointError, match="has a header that cannot be used"):
        rts.load_checkpoint(tmp_path / "empty.npz")


def test_no_pickle_and_no_array_larger_than_its_file(whole, tmp_path):
    with pytest.raises(ValueError, match="Object arrays"):
        write_archive(tmp_path / "object.npz", {}, {"x": np.array([print])})
    assert not (tmp_path / "object.npz").exists()
    lying = tmp_path / "lying.npz"
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(lying, "w") as target:
        target.writestr("header.json", "{}")
        target.writestr("x.npy", source.read("x.npy").replace(b"(3, 4), }  ", b"(3, 4000), }", 1)[:-1])
    with zipfile.ZipFile(lying) as archive:
        reader = object.__new__(checkpoint.Archive)
        reader.path, reader.zip = lying, archive
        with pytest.raises(rts.CheckpointError, match="has no array x that can be read"):
            reader.array("x")


def test_differences_are_named():
    assert differences({"a": 1, "b": 2}, {"a": 1, "b": 3, "c": 4}) == "b 2 there and 3 here, c None there and 4 here"
    assert differences({"a": 1}, {"a": 1}) == ""
    assert differences({"name": "x", "b": 2}, {"name": "y", "b": 3}) == "name 'x' there and 'y' here"


@pytest.mark.slow
def test_another_arch_goes_on_with_it(start_taichi, taichi_vulkan, tmp_path):
    """What serves one arch alone, such as windows and lists of a sort, is not in the file."""
    scene = rts.load_scene("dam_break_2d", particles="1k", sound_speed="regional")
    ends = []
    sim = rts.Simulation(scene, rts.Regional())
    sim.advance_to(EARLY)
    checkpoint.save_checkpoint(sim, tmp_path / "vulkan.npz")
    sim.advance_to(LATE)
    ends.append(sim.positions())
    with start_taichi("cpu", "f32"):
        sim = checkpoint.load_checkpoint(tmp_path / "vulkan.npz")
        sim.advance_to(LATE)
        ends.append(sim.positions())
    assert np.abs(ends[1] - ends[0]).max() < 1e-3 * scene.spacing
