"""Forks of Taichi give what Taichi gives, to rounding: each in a new virtual environment, where its wheel can be had."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import wheel

from taichi_rts.device.backend import FORK

HERE = Path(__file__).parent
UNREACHABLE = ("Connection", "No matching distribution", "Temporary failure", "Could not find a version")


def run(python, fork, path, **more):
    """Run the small scenes with a fork; returns what they gave."""
    environment = os.environ | {"TAICHI_RTS_TAICHI": fork, "PYTHONPATH": str(wheel.ROOT)} | more
    done = subprocess.run(
        [str(python), str(HERE / "fork_runs.py"), str(path)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    assert done.returncode == 0, done.stderr[-1500:]
    assert done.stdout.split()[-1] == fork
    return dict(np.load(path))


@pytest.fixture(scope="module")
def expected(tmp_path_factory, quick_environment):
    return run(sys.executable, "taichi", tmp_path_factory.mktemp("taichi") / "taichi.npz")


@pytest.mark.slow
@pytest.mark.skipif(FORK.module != "taichi", reason="Taichi itself is what forks are compared with")
@pytest.mark.parametrize(("fork", "package"), [("taichi_forge", "taichi-forge>=0.7"), ("quadrants", "quadrants>=1.3")])
def test_a_fork_gives_what_taichi_gives(tmp_path, expected, fork, package):
    python = wheel.environment(tmp_path)
    # All else is taken from the environment that runs the tests.
    site = next((tmp_path / "venv" / "lib").glob("python3.*")) / "site-packages"
    here = [path for path in sys.path if Path(path).name == "site-packages"]
    (site / "tests.pth").write_text("\n".join(here))
    try:
        wheel.call(
            python,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--only-binary",
            ":all:",
            package,
            cwd=tmp_path,
        )
    except RuntimeError as error:
        if any(words in str(error) for words in UNREACHABLE):
            pytest.skip(f"no wheel of {fork} can be had: {str(error).splitlines()[-1]}")
        raise
    found = run(python, fork, tmp_path / "fork.npz")
    assert len(expected) == 4
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=0, atol=1e-12, err_msg=name)
