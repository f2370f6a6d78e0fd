"""Reads a command of the docs as the real command line would, and says what is wrong with it, without running it."""

import ast
import re
import shlex
from pathlib import Path

import tyro
from documents import ROOT

import taichi_rts as rts
from taichi_rts.commands.main import Command, parse_demo
from taichi_rts.commands.run import Run, check_angles, check_size
from taichi_rts.compare.command import Compare
from taichi_rts.compare.runner import plan
from taichi_rts.rendering.painter import make_cameras
from taichi_rts.stability.cases import CASES
from taichi_rts.stability.command import Stability, choose
from taichi_rts.stability.suite import SETTINGS

STAND_INS = {"SCENE": "dam_break_2d", "ADDRESS": "local", "FILE": "state.npz"}
"""What capital letters stand for in the docs."""
FOREIGN = {"pip", "uv", "python3", ".", "apt-get"}
"""Programs that are not ours: of pip only the extras are looked at."""


def check(words, loaded):
    """Raise or exit if a command is wrong; `loaded` keeps scenes that were loaded before."""
    words = [STAND_INS.get(word, word) for word in words if word != "..."]
    program, *rest = words[1:] if words[0] == "xvfb-run" else words
    if program == "taichi-rts":
        check_ours(tuple(rest), loaded)
    elif program == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
        assert set(rest) <= set(targets), f"make has no {rest}"
    elif program == "python" and rest[0] == "-m":
        check_module(rest[1:])
    elif program == "python" and rest[0] != "-c":
        check_script(ROOT / rest[0], rest[1:])
    elif program == "pip":
        check_extras(rest)
    else:
        assert program in FOREIGN, f"what is {program}? List it in checking.FOREIGN if it is not ours"


def check_ours(args, loaded):
    """Check a command of `taichi-rts`: its options, its scene, and what its options say together."""
    if "--help" in args:
        args = tuple(arg for arg in args if arg != "--help")
    command = tyro.cli(Command, args=list(args))
    if isinstance(command, Run):
        check_run(command, loaded)
    elif isinstance(command, Compare):
        command.settings()
        scene = command.load()
        plan(scene, command.settings())
    elif isinstance(command, Stability):
        choose("case", command.cases, CASES)
        choose("stepper", command.steppers, SETTINGS)


def check_run(run, loaded):
    """Check what `Run` says before anything starts."""
    stepper = run.stepping.make()
    check_size(run.pictures.width, run.pictures.height)
    check_angles(run.pictures.azimuth, run.pictures.elevation)
    if run.resume is not None:
        return
    key = run.scene
    if key not in loaded:
        loaded[key] = run.scene.load()
    scene = loaded[key]
    run.make_panels(scene.name, stepper)
    make_cameras(scene, run.pictures)
    rts.Exporter("out", run.files.export, run.files.attributes, dim=scene.dim)


def check_module(rest):
    """Check `python -m pytest FILE -k WORD`, and modules of ours."""
    if rest[0] == "pytest":
        path = ROOT / rest[1]
        assert path.is_file(), f"{rest[1]} is not there"
        if "-k" in rest:
            word = rest[rest.index("-k") + 1]
            assert re.search(rf"def test_\w*{word}", path.read_text()), f"{rest[1]} has no test {word}"
        return
    folder = ROOT / rest[0].replace(".", "/")
    assert folder.with_suffix(".py").is_file() or (folder / "__main__.py").is_file(), f"there is no module {rest[0]}"


def check_script(path, rest):
    """Check the options of a demo as `taichi-rts run`; of another script, that it knows every word."""
    assert path.is_file(), f"{path} is not there"
    if path.parent.name == "demos":
        parse_demo(Run(), rest)
        return
    source = path.read_text(encoding="utf-8")
    ast.parse(source)
    for imported in re.findall(r"^from (\w+) import", source, flags=re.MULTILINE):
        for near in (path.parent, ROOT / "tests" / "validation"):
            source += (near / f"{imported}.py").read_text() if (near / f"{imported}.py").is_file() else ""
    known = set(re.findall(r"\w+", source)) | {f.stem for f in ROOT.glob("taichi_rts/scenes/*.toml")} | {"regional-c"}
    for word in filter(None, ",".join(rest).split(",")):
        option = word.removeprefix("--").replace("-", "_") if word.startswith("--") else word
        assert option in known or re.fullmatch(r"[\d.]+", word), f"{path.name} knows no {word}"


def check_extras(rest):
    """Check that the extras that pip is asked for exist."""
    text = (ROOT / "pyproject.toml").read_text()
    for word in rest:
        for extra in re.findall(r"\[([\w,]+)\]", word):
            assert all(re.search(rf"^{each} = \[", text, flags=re.MULTILINE) for each in extra.split(",")), word


def as_text(words):
    """A command as it stands in the docs."""
    return shlex.join(map(str, words))


def write_stand_ins(folder: Path, files):
    """Write the scene files that the docs speak of: those that stand there, and stand-ins for a reader's own."""
    tank = (
        "spacing = 0.1\ndomain = { lower = [0, 0], upper = [1, 1] }\n[[fluids]]\nlower = [0, 0]\nupper = [0.4, 0.6]\n"
    )
    box = '{"Configuration": {"particleRadius": 0.05}, "FluidBlocks": [{"start": [0, 0, 0], "end": [0.5, 0.5, 0.5]}]}'
    for name, text in {"my_scene.toml": tank, "DamBreakModel.json": box, "scene.json": box, **files}.items():
        (folder / name).write_text(text, encoding="utf-8")
