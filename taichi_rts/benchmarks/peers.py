"""SPlisHSPlasH's side of the comparison, where PyPI's pysplishsplash is installed: a script in a process of its own."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

SCRIPT = Path("..") / "shared" / "peers" / "splishsplash_dam_break.py"
GL_LIBRARIES = ("libGLX.so.0", "libGLdispatch.so.0")  # its wheel brings one that clashes with the system's


def peer_is_there(script: Path) -> bool:
    """Whether the peer can be run."""
    return script.is_file() and importlib.util.find_spec("pysplishsplash") is not None


def run_peer(script: Path, method: str, cells: int, end_time: float, threads: int) -> dict[str, Any] | None:
    """Run the peer's dam break with `cells` particles along 1 m to `end_time` [s]; return what it prints, None if it fails."""
    listed = subprocess.run(["/sbin/ldconfig", "-p"], capture_output=True, text=True, check=False).stdout
    found = [re.search(rf"{re.escape(name)} .*x86-64.* => (\S+)", listed) for name in GL_LIBRARIES]
    environment = {
        **os.environ,
        "LD_PRELOAD": ":".join(match[1] for match in found if match),
        "OMP_NUM_THREADS": str(threads),
    }
    options = ["--method", method, "--cells", str(cells), "--end-time", str(end_time)]
    done = subprocess.run(
        [sys.executable, str(script), *options], env=environment, capture_output=True, text=True, check=False
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    return json.loads(lines[-1]) if lines else None
