"""A run from the command line that is killed, stopped or loses its disk, and goes on; and what is refused."""

import os
import random
import shutil
import signal
import sys
import time
from pathlib import Path

import pytest

import taichi_rts as rts
from taichi_rts.commands.interrupts import Interrupts
from taichi_rts.commands.main import main
from taichi_rts.device.backend import ti
from taichi_rts.output.recorder import Recorder, checkpoint_times
from taichi_rts.output.resume import checkpoint_name, newest

sys.path.append(str(Path(__file__).parents[3] / "studies"))
from faults import TINY, differing, files, finish, mount, progress, start, wait_for

RUN = ["run", "dam_break_2d", "--arch", "cpu", "--spacing", "0.1", "--end-time", "0.055", "--export-fps", "100"]
RUN += [
    "--width",
    "160",
    "--height",
    "90",
    "--checkpoint-every",
    "0.02",
    "--video",
    "--stepper",
    "uniform",
    "--export",
    "vtu",
]


@pytest.fixture(scope="module", autouse=True)
def ended(quick_environment):
    """Ends the last simulation."""
    yield
    ti.reset()


@pytest.fixture(scope="module")
def reference(tmp_path_factory, ended):
    folder = tmp_path_factory.mktemp("reference") / "out"
    main([*RUN, "--output-dir", str(folder)])
    return folder


@pytest.fixture(scope="module")
def wanted(reference):
    return files(reference)


def command(*args):
    """Run in this process; returns the exit code."""
    try:
        main([str(each) for each in args])
    except SystemExit as stop:
        return stop.code
    return 0


def at_frame(monkeypatch, number, act):
    """Have `act(recorder)` called when a frame has just been written."""
    moments = Recorder.moments

    def watched(self, end_time):
        for moment, frame in moments(self, end_time):
            yield moment, frame
            if frame == number:
                act(self)

    monkeypatch.setattr(Recorder, "moments", watched)


def test_names_sort_by_time_and_times_end_at_the_end():
    times = [0.0, 1e-9, 0.5, 9.999, 10.0, 123456.789]
    assert sorted(map(checkpoint_name, times)) == [checkpoint_name(time) for time in times]
    assert list(checkpoint_times(0.35, 0.1)) == [0.1, 0.2, pytest.approx(0.3), 0.35]
    assert list(checkpoint_times(0.2, 0.1)) == [0.1, 0.2]
    assert list(checkpoint_times(0.2, None)) == []


def test_a_run_writes_checkpoints_and_nothing_else_there(reference, wanted):
    names = ["000000.020000000.npz", "000000.040000000.npz", "000000.055000000.npz"]
    assert sorted(path.name for path in (reference / "checkpoints").iterdir()) == names
    found = sorted(path.name for path in reference.iterdir())
    assert found == ["checkpoints", "frames", "particles", "run.json", "series.csv", "video.mp4"]
    assert len(wanted) == 8


def change_the_clock(folder, monkeypatch):
    """What is newest follows from names; files may bear any date, and the clock may jump while it runs."""
    last = newest(folder)
    for year, path in zip((2100, 1980, 1990), sorted((folder / "checkpoints").iterdir()), strict=False):
        os.utime(path, (seconds := (year - 1970) * 365 * 86400, seconds))
    assert newest(folder) == last
    jumps, now = random.Random(5), time.time()
    monkeypatch.setattr(time, "time", lambda: now + jumps.uniform(-1e8, 1e8))


def test_a_signal_ends_it_whole_and_it_goes_on_whatever_the_clock_says(
    tmp_path, monkeypatch, capsys, wanted, reference
):
    folder, number = tmp_path / "out", signal.SIGTERM
    at_frame(monkeypatch, 2, lambda recorder: os.kill(os.getpid(), number))
    assert command(*RUN, "--output-dir", folder) == 128 + number
    said = capsys.readouterr().err
    assert f"interrupted; 3 frames are whole, until t = 0.02 s; to go on: taichi-rts run --resume {folder}" in said
    assert not (folder / "run.json").exists()
    assert sorted(path.name for path in folder.iterdir()) == ["checkpoints", "frames", "particles", "series.csv"]
    assert float(newest(folder).stem) > 0.02
    monkeypatch.undo()
    change_the_clock(folder, monkeypatch)
    assert command("run", "--resume", folder) == 0
    assert files(folder) == wanted
    beside = ["video.mp4", "series.csv", *(f"particles/{path.name}" for path in (reference / "particles").iterdir())]
    assert len(beside) == 2 + 7 + 1  # one for each frame, and the collection
    for name in beside:
        assert (folder / name).read_bytes() == (reference / name).read_bytes()


def test_kill_9_and_the_same_bits(tmp_path, capsys, wanted, reference):
    folder, chance = tmp_path / "out", random.Random(3)
    process = start(*RUN, "--output-dir", str(folder))
    moment = chance.randrange(4, 6)
    wait_for(process, lambda: progress(folder) > moment)
    time.sleep(0.01 * chance.random())
    process.kill()
    assert finish(process)[0] == -signal.SIGKILL
    assert all(wanted[name] == data for name, data in files(folder).items())
    assert command("run", "--resume", folder) == 0
    assert f"was left by process {process.pid}, which is dead" in capsys.readouterr().err
    assert files(folder) == wanted
    assert (folder / "series.csv").read_bytes() == (reference / "series.csv").read_bytes()


def test_a_full_disk_is_a_clear_error_and_costs_nothing(tmp_path, capsys, wanted):
    disk = tmp_path / "disk"
    disk.mkdir()
    if os.geteuid() or mount("-t", "tmpfs", "-o", f"size={TINY // 5}", "tmpfs", str(disk)):
        pytest.skip("mounting a small disk needs root")
    try:
        assert command(*RUN, "--output-dir", disk / "out") == 2
        said = capsys.readouterr().err
        for word in ("No space left on device; free some space", "frames are whole", "--resume"):
            assert word in said
        assert len(said.strip().splitlines()) == 1
        found = files(disk / "out")
        assert found
        assert not differing(wanted, found)
        assert mount("-o", f"remount,size={TINY}", str(disk)) == 0
        assert command("run", "--resume", disk / "out") == 0
        assert files(disk / "out") == wanted
    finally:
        os.system(f"umount {disk}")


def test_a_deleted_folder_is_made_again(tmp_path, monkeypatch, capsys, wanted):
    folder = tmp_path / "out"
    at_frame(monkeypatch, 2, lambda recorder: shutil.rmtree(folder))
    assert command(*RUN, "--output-dir", folder) == 0
    said = capsys.readouterr().err
    assert "has gone and was made again; frames before 000003" in said
    assert "video.mp4 is lost" in said
    left = {name: data for name, data in wanted.items() if name not in ("000000.png", "000001.png", "000002.png")}
    assert files(folder) == left


# -- what is refused, and what is not -------------------------------------------------------------------------------


@pytest.fixture
def copy(reference, tmp_path):
    shutil.copytree(reference, tmp_path / "copy")
    return tmp_path / "copy"


def test_a_finished_run_has_nothing_to_go_on_with(copy, capsys):
    before = {path: path.stat().st_mtime_ns for path in copy.rglob("*")}
    for what in (copy, newest(copy)):
        assert command("run", "--resume", what) == 0
        assert "is finished (t = 0.055 s)" in capsys.readouterr().out
    shutil.rmtree(copy / "checkpoints")
    assert command("run", "--resume", copy) == 0
    (copy / "run.json").unlink()
    assert command("run", "--resume", copy) == 2
    assert "holds no whole checkpoint; start the run again" in capsys.readouterr().err
    assert not {path for path in copy.rglob("*") if path.stat().st_mtime_ns != before.get(path)} - {copy}


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["--spacing", "0.05"], ["of another scene: spacing 0.1 there and 0.05 here"]),
        (["projectile"], ["of another scene: name 'dam_break_2d' there and 'projectile' here"]),
        (["--stepper", "regional"], ["of another stepper: name 'uniform' there and 'regional' here"]),
        (["--courant", "0.3"], ["of another stepper: courant 0.4 there and 0.3 here"]),
        (["--panels", "steppers"], ["--panels steppers has steppers of its own; leave out --stepper"]),
        (["--precision", "f64"], ["precision 'f32' there and 'f64' here"]),
        (["--export-fps", "50"], ["export_fps 100.0 there and 50.0 here"]),
        (["--debug"], ["debug False there and True here"]),
        (["--gui"], ["--resume", "or --gui"]),
        (["--checkpoint-every", "0", "--overwrite"], ["--checkpoint-every 0 is no time above 0"]),
        (["--end-time", "-1"], ["end_time"]),
    ],
)
def test_what_contradicts_the_checkpoint_is_refused(reference, capsys, args, words):
    before = sorted(reference.rglob("*"))
    assert command("run", *args, "--resume", reference) == 2
    said = capsys.readouterr().err
    for word in words:
        assert word in said
    assert "Traceback" not in said
    assert sorted(reference.rglob("*")) == before


@pytest.mark.slow
def test_overwrite_never_takes_the_checkpoint_away(copy, tmp_path, capsys, wanted):
    first = sorted((copy / "checkpoints").iterdir())[0]
    inside = copy / "frames" / "mine.npz"
    first.rename(inside)
    assert command("run", "--resume", inside, "--output-dir", copy, "--overwrite") == 2
    assert "choose another --output-dir" in capsys.readouterr().err
    assert inside.exists()
    inside.rename(first)
    assert command("run", "--resume", first, "--overwrite", "--end-time", "0.075") == 0
    assert first.exists()
    found = files(copy)
    assert found["000005.png"] == wanted["000005.png"]
    assert found["000006.png"] != wanted["000006.png"]  # which was that of 0.055 s, and now is that of 0.06 s
    assert sorted(found) == [f"{n:06d}.png" for n in range(9)] + ["run.json"]


def test_a_second_signal_ends_it_at_once():
    def signals():
        with Interrupts() as interrupts:
            interrupts.defer()
            os.kill(os.getpid(), signal.SIGTERM)
            assert interrupts.asked()
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt) as stop:
        signals()
    assert stop.value.exit_code == 130
    assert not isinstance(stop.value, rts.errors.Interrupted)
