"""Programs that tests start in processes of their own."""

import os
import subprocess
import sys

POOL = (
    "rts.Scene(domain=rts.Box((0, 0), (1, 0.8)), fluids=[rts.Block((0, 0), (0.4, 0.5))], spacing=0.1, "
    "gravity=(0, -9.81), end_time=0.1)"
)
PRELUDE = f"import taichi_rts as rts\ndef build(): return rts.Simulation({POOL}, rts.Uniform())\n"
TIMEOUT = 120.0


def environment(**changes):
    """The present environment with `changes`; what is None is taken out."""
    return {key: value for key, value in (os.environ | changes).items() if value is not None}


def run_program(code, folder, prelude=PRELUDE, **changes):
    """Write `code` to a file, for processes that it spawns, and run it."""
    path = folder / "program.py"
    path.write_text(prelude + code, encoding="utf-8")
    return run(sys.executable, str(path), folder=folder, **changes)


def run(*command, folder, timeout=TIMEOUT, **changes):
    return subprocess.run(
        command,
        capture_output=True,
        text=True,
        encoding="latin-1",  # decodes whatever comes
        cwd=folder,
        env=environment(**changes),
        timeout=timeout,
        check=False,
    )
