"""One run at a time in a folder: real processes."""

import json
import platform
import shutil
import signal
import subprocess
import sys

import pytest

from taichi_rts.errors import OutputError
from taichi_rts.files import lock
from taichi_rts.files.lock import FolderLock

HOLD = "import sys, time; from pathlib import Path; from taichi_rts.files.lock import FolderLock; "
HOLD += "lock = FolderLock(Path(sys.argv[1])); print('held', flush=True); time.sleep(60)"


def test_the_second_run_refuses_and_a_dead_one_is_taken_over(tmp_path):
    folder = tmp_path / "out"
    other = subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True)
    assert other.stdout.readline() == "held\n"
    with pytest.raises(OutputError, match=f"is being written to by process {other.pid} on .*another --output-dir"):
        FolderLock(folder)
    other.send_signal(signal.SIGKILL)
    other.wait()
    assert (folder / ".lock").exists()
    with pytest.warns(UserWarning, match=f"left by process {other.pid}, which is dead"):
        mine = FolderLock(folder)
    assert mine.check()
    mine.release()
    assert list(folder.iterdir()) == []
    FolderLock(folder).release()  # without a warning


def test_a_folder_that_was_deleted_is_locked_again_unless_another_run_has_it(tmp_path):
    folder = tmp_path / "out"
    mine = FolderLock(folder)
    shutil.rmtree(folder)
    assert not mine.check()
    assert mine.check()
    shutil.rmtree(folder)
    other = FolderLock(folder)
    for _ in range(2):
        with pytest.raises(OutputError, match="is being written to"):
            mine.check()
    mine.release()
    assert other.check()
    other.release()


def test_where_locked_files_cannot_be_read_a_second_file_is_locked(tmp_path, monkeypatch):
    pytest.importorskip("filelock")
    monkeypatch.setattr(lock, "fcntl", None)  # as on Windows
    folder = tmp_path / "out"
    code = HOLD.replace("lock = ", "import taichi_rts.files.lock as m; m.fcntl = None; lock = ")
    other = subprocess.Popen([sys.executable, "-c", code, str(folder)], stdout=subprocess.PIPE, text=True)
    assert other.stdout.readline() == "held\n"
    with pytest.raises(OutputError, match=f"is being written to by process {other.pid} on "):
        FolderLock(folder)
    other.send_signal(signal.SIGKILL)
    other.wait()
    with pytest.warns(UserWarning, match=f"left by process {other.pid}, which is dead"):
        mine = FolderLock(folder)
    assert mine.check()
    with pytest.raises(OutputError, match="is being written to"):
        FolderLock(folder)
    mine.release()
    assert not (folder / ".lock").exists()
    FolderLock(folder).release()  # without a warning


def test_what_another_host_says_is_believed(tmp_path):
    (tmp_path / ".lock").write_text(json.dumps({"pid": 1, "host": platform.node() + "x"}))
    with pytest.raises(OutputError, match=r"if that run is dead, delete .*\.lock"):
        FolderLock(tmp_path)
    (tmp_path / ".lock").write_text("{ no json")
    FolderLock(tmp_path).release()
