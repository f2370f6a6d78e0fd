"""The built wheel in a virtual environment of its own: builds it, installs it, tries it from outside the sources."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
IMPORT_ALL = """
import importlib, importlib.util, pkgutil, sys
import taichi_rts
assert "site-packages" in taichi_rts.__file__, taichi_rts.__file__
names = [each.name for each in pkgutil.walk_packages(taichi_rts.__path__, "taichi_rts.") if "__main__" not in each.name]
for name in names:
    importlib.import_module(name)
packages = ("imageio_ffmpeg", "matplotlib", "distributed", "h5py", "pysplashsurf", "trimesh", "Xlib")
extras = [each for each in packages if importlib.util.find_spec(each)]
print(len(names), len(taichi_rts.scene_names()), *extras)
"""
"""Prints how many modules could be imported, how many scenes came along, and which extras are there."""
DEMO = (
    "--arch",
    "cpu",
    "--spacing",
    "0.1",
    "--end-time",
    "0.05",
    "--export-fps",
    "20",
    "--width",
    "256",
    "--height",
    "144",
)


def call(*command, cwd):
    """Run a command that has to succeed; returns what it prints."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}
    done = subprocess.run([*map(str, command)], cwd=cwd, env=clean, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{command[0]} ended with {done.returncode}: {done.stderr.strip()[-1500:]}")
    return done.stdout


def build(folder):
    """Build the wheel into `folder`, from a copy of the sources; returns its path."""
    copy = folder / "source"
    copy.mkdir()
    parts = ("pyproject.toml", "README.md", "LICENSE", "taichi_rts")
    call("cp", "-r", *(ROOT / part for part in parts), copy, cwd=folder)  # setuptools writes beside what it builds
    call(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, copy, cwd=folder)
    return next(folder.glob("*.whl"))


def environment(folder, python=sys.executable):
    """Make a new virtual environment; returns its interpreter."""
    call(python, "-m", "venv", folder / "venv", cwd=folder)
    return folder / "venv" / "bin" / "python"


def try_out(python, folder):
    """Import every module and run the demo, shortened, outside the sources; returns what `IMPORT_ALL` prints, as words."""
    words = call(python, "-c", IMPORT_ALL, cwd=folder).split()
    call(python, ROOT / "demos" / "double_dam_break.py", *DEMO, "--output-dir", folder / "out", cwd=folder)
    frames = sorted((folder / "out" / "frames").glob("*.png"))
    if len(frames) != 2 or not (folder / "out" / "run.json").exists():
        raise RuntimeError(f"the demo wrote {len(frames)} frames where 2 were to be")
    return words
