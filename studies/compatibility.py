"""The built wheel with the oldest and the newest packages it allows: python studies/compatibility.py [--python 3.12].

Needs uv (pip install uv) to choose the oldest. Prints a table (docs/evidence/reliability.md): each row is a new virtual
environment, in which every module is imported and the demo is run.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from tables import head, row

sys.path.append(str(Path(__file__).parents[1] / "tests" / "reliability"))
import wheel

CORE = ("taichi", "numpy", "scipy", "imageio", "pillow", "pydantic", "tyro", "rich")


def attempt(built, python, resolution, extras):
    """Return the cells of one row."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        inside = folder / "venv" / "bin" / "python"
        wheel.call("uv", "venv", "--quiet", "--python", python, folder / "venv", cwd=folder)
        install = ("uv", "pip", "install", "--quiet", "--python", inside)
        wanted = [word for extra in extras for word in ("--extra", extra)]
        wheel.call(*install, "--resolution", resolution, "-r", wheel.ROOT / "pyproject.toml", *wanted, cwd=folder)
        wheel.call(*install, "--no-deps", built, cwd=folder)
        listed = wheel.call("uv", "pip", "list", "--python", inside, cwd=folder).lower().splitlines()
        versions = dict(line.split()[:2] for line in listed[2:])
        try:
            modules, *_ = wheel.try_out(inside, folder)
            outcome = f"{modules} modules imported, demo runs"
        except RuntimeError as error:
            outcome = f"**FAILS** {str(error).splitlines()[-1]}"
        number = wheel.call(inside, "-c", "import platform; print(platform.python_version())", cwd=folder).strip()
    return (
        number,
        resolution,
        " ".join(extras) or "none",
        ", ".join(f"{name} {versions.get(name)}" for name in CORE),
        outcome,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", nargs="*", default=[f"{sys.version_info.major}.{sys.version_info.minor}"])
    parser.add_argument("--extras", nargs="*", default=[])
    options = parser.parse_args()
    if shutil.which("uv") is None:
        raise SystemExit("uv is not on the path; pip install uv")
    head("Python", "versions", "extras", "packages", "outcome")
    with tempfile.TemporaryDirectory() as scratch:
        built = wheel.build(Path(scratch))
        for python in options.python:
            for resolution in ("lowest-direct", "highest"):
                row(*attempt(built, python, resolution, options.extras))


if __name__ == "__main__":
    main()
