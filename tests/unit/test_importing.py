"""Ctrl-C while the program is imported: a module that takes long stands in for the seconds that a cold start takes."""

import os
import signal
import subprocess
import sys

import pytest
from programs import environment

from taichi_rts.importing import runs_as_program

SLOW = "import time\nprint('importing', flush=True)\ntime.sleep(60)\n"
SCRIPT = "import sys\nfrom taichi_rts.commands.main import main\nif __name__ == '__main__':\n    sys.exit(main())\n"


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("way", ["taichi-rts", "python -m taichi_rts", "python -m taichi_rts.benchmarks"])
@pytest.mark.parametrize("module", ["taichi", "tyro"])
def test_interrupted_while_importing(tmp_path, way, module):
    (tmp_path / "slow").mkdir()
    (tmp_path / "slow" / f"{module}.py").write_text(SLOW)
    (tmp_path / "taichi-rts").write_text(SCRIPT)
    command = [str(tmp_path / "taichi-rts")] if way == "taichi-rts" else way.split()[1:]
    path = os.pathsep.join([str(tmp_path / "slow"), *filter(None, [os.environ.get("PYTHONPATH", os.getcwd())])])
    process = subprocess.Popen(
        [sys.executable, *command, "scenes"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(PYTHONPATH=path),
    )
    assert process.stdout.readline() == "importing\n"
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=30)
    assert process.returncode == 130
    assert error == "taichi-rts: interrupted while starting; nothing was written\n"


def test_scripts_that_import_the_package_keep_their_ctrl_c():
    code = "import signal, taichi_rts; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"


def test_the_program_is_known_by_its_name():
    assert runs_as_program(["/usr/bin/taichi-rts", "run"], ["python", "/usr/bin/taichi-rts", "run"])
    assert runs_as_program([r"taichi-rts.exe"], [])
    assert runs_as_program(["-m", "run"], ["python", "-X", "dev", "-m", "taichi_rts", "run"])
    assert not runs_as_program(["-m"], ["python", "-m", "pytest"])
    assert not runs_as_program(["-m"], ["python", "-mtaichi"])
    assert not runs_as_program(["/home/me/taichi-rts.py"], ["python", "taichi-rts.py"])
    assert not runs_as_program([], ["python"])
    spawned = ["python", "-c", "from multiprocessing.spawn import spawn_main; spawn_main()", "--multiprocessing-fork"]
    assert not runs_as_program(["/usr/bin/taichi-rts"], spawned)
