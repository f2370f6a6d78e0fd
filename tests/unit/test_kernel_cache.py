"""Homes in which Taichi ends the process: unset, not there, not a folder."""

import os
import sys

import pytest
from programs import run, run_program

pytestmark = pytest.mark.skipif(os.name == "nt", reason="HOME means nothing there")
CODE = """
from taichi_rts.device.backend import ti
rts.init("cpu")
field = ti.field(ti.f32, 4)
field.fill(1.5)  # a kernel, which Taichi writes to its cache when the process ends
print(field[3])
"""
NOWHERE = {"XDG_CACHE_HOME": None, "TI_OFFLINE_CACHE_FILE_PATH": None, "TI_ADVANCED_OPTIMIZATION": "0"}


def homes(folder):
    (folder / "with_a_file").mkdir()
    (folder / "with_a_file" / ".cache").write_text("no folder")
    return {
        "unset": None,
        "empty": "",
        "not there": "/proc/none",
        "a file where the folder should be": str(folder / "with_a_file"),
    }


@pytest.mark.parametrize(
    "home", ["unset", pytest.param("empty", marks=pytest.mark.slow), "not there", "a file where the folder should be"]
)
def test_without_a_cache_it_runs_and_warns_once(tmp_path, home):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    done = run_program(CODE, tmp_path, HOME=homes(tmp_path)[home], TMPDIR=str(temporary), **NOWHERE)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "1.5\n"
    assert done.stderr.count("UserWarning") == 1
    assert "compiled kernels are not kept" in done.stderr
    assert "set TI_OFFLINE_CACHE_FILE_PATH or XDG_CACHE_HOME to a folder that can be written to" in done.stderr
    assert ("neither HOME nor XDG_CACHE_HOME is set" in done.stderr) == (home in ("unset", "empty"))
    assert list(temporary.iterdir()) == []  # nothing stays behind


def test_a_named_cache_that_cannot_be_written_to(tmp_path):
    (tmp_path / "file").write_text("no folder")
    named = NOWHERE | {"TI_OFFLINE_CACHE_FILE_PATH": str(tmp_path / "file" / "cache")}
    done = run_program(CODE, tmp_path, **named)
    assert (done.returncode, done.stdout) == (0, "1.5\n")
    assert done.stderr.count("UserWarning") == 1


def test_a_named_cache_is_used_without_a_home(tmp_path):
    named = NOWHERE | {"XDG_CACHE_HOME": str(tmp_path / "caches")}
    done = run_program(CODE, tmp_path, HOME=None, **named)
    assert (done.returncode, done.stdout, done.stderr) == (0, "1.5\n", "")
    assert list((tmp_path / "caches").rglob("*.tcb"))


@pytest.mark.parametrize("home", ["unset", pytest.param("not there", marks=pytest.mark.slow)])
def test_the_command_line_warns_in_one_line(tmp_path, home):
    command = ["run", "dam_break_2d", "--spacing", "0.1", "--end-time", "0.02", "--no-frames", "--arch", "cpu"]
    command += ["--stepper", "uniform"]
    done = run(
        *(sys.executable, "-m", "taichi_rts", *command, "--output-dir", str(tmp_path / "out")),
        folder=tmp_path,
        HOME=homes(tmp_path)[home],
        **NOWHERE,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("taichi-rts: warning: compiled kernels are not kept") == 1
    assert "Traceback" not in done.stderr
    assert (tmp_path / "out" / "run.json").is_file()


def test_the_command_line_keeps_its_kernels(tmp_path):
    """Also where something still refers to the simulation as the process ends."""
    named = NOWHERE | {"XDG_CACHE_HOME": str(tmp_path / "caches")}
    code = """
from taichi_rts.commands.main import main
main("run hydrostatic_column --arch cpu --end-time 0.001 --no-frames --stepper uniform".split())
"""
    done = run_program(code, tmp_path, HOME=None, **named)
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "caches").rglob("*.tic"))) > 10
