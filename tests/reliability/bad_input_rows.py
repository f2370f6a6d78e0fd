"""All bad input that is tried, one list: the tests run it, and tests/benchmarks/bad_input.py prints it as a table."""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import scenes
from scenes import FLAT, MISSING, SOLID, changed, paths, to_toml, value_at

KINDS = ("missing", "wrong type", "NaN", "infinite", "negative", "zero", "huge", "tiny")
VALID = {
    "gravity": {"missing"},
    "gravity_changes": {"missing"},
    "body_force": {"missing"},
    "body_force.value": {"missing"},
    "body_force.origin": {"missing"},
    "density": {"missing"},
    "background_pressure": {"missing", "zero", "tiny"},
    "kernel": {"missing"},
    "support_ratio": {"missing"},
    "rest_density": {"missing"},
    "artificial_viscosity": {"missing", "zero", "tiny"},
    "kinematic_viscosity": {"missing", "zero", "tiny"},
    "hydrostatic": {"missing"},
    "walls": {"missing"},
    "periodic": {"missing"},
    "end_time": {"missing"},
    "name": {"missing"},
    "description": {"missing"},
    "fluids.0.velocity": {"missing"},
    "fluids.0.kinematic_viscosity": {"missing", "zero", "tiny"},
    "fluids.1.velocity": {"missing"},
    "moving_walls": {"missing"},
    "inflows": {"missing"},
    "inflows.0.start": {"missing", "zero", "tiny"},
    "inflows.0.stop": {"missing"},
    "probes": {"missing"},
    "probes.0.name": {"missing"},
    "gauges": {"missing"},
    "gauges.0.name": {"missing"},
    "obstacles": {"missing"},
    "obstacles.0.rotation": {"missing"},
    "obstacles.0.motion": {"missing"},
    "obstacles.0.motion.velocity": {"missing"},
    "obstacles.0.motion.angular_velocity": {"missing"},
    "obstacles.0.motion.pivot": {"missing"},
    "obstacles.0.motion.start": {"missing", "zero", "tiny"},
    "obstacles.0.motion.stop": {"missing"},
    "obstacles.1.motion": {"missing"},
    "obstacles.1.motion.displacements": {"missing"},
    "obstacles.1.motion.rotations": {"missing"},
    "obstacles.1.motion.pivot": {"missing"},
    "obstacles.3.rotation": {"missing"},
    "view": {"missing"},
    "view.azimuth": {"missing", "negative", "zero", "tiny"},
    "view.elevation": {"missing", "negative", "zero", "tiny"},
    "view.eye": {"missing"},
    "view.target": {"missing"},
    "view.zoom": {"missing"},
    "sound_speed.mach": {"missing"},
    "sound_speed.memory": {"missing"},
    "sound_speed.floor": {"missing"},
    "sound_speed.cap": {"missing"},
}
"""What is no mistake: fields that may be left out, and numbers that may be 0, next to it, or negative."""


@dataclass(frozen=True)
class FieldRow:
    """A field of a scene file and how it is spoilt, by kind: the scene and what has to be said, None where that is valid."""

    name: str
    scenes: dict[str, tuple[dict[str, Any], bool]]


def field_rows() -> list[FieldRow]:
    """Return a row for each field of `SOLID`, and of `FLAT` for what only two dimensions have."""
    rows = []
    wholes = [(SOLID, paths(SOLID)), (FLAT, [p for p in paths(FLAT) if p[0] in ("sound_speed",) or "velocity" in p])]
    wholes[1][1].extend(p for p in paths(FLAT) if p[0] == "obstacles" and len(p) > 2)
    for whole, found in wholes:
        for path in found:
            if len(path) > 1 and isinstance(path[-1], int) and isinstance(value_at(whole, path), dict):
                continue  # parts of a list, each of which may be left out
            name = ".".join(map(str, path))
            rows.append(FieldRow(name, _spoilt(whole, path, VALID.get(name, set()))))
    return rows


def _spoilt(whole: dict[str, Any], path: scenes.Path, valid: set[str]) -> dict[str, tuple[dict[str, Any], bool]]:
    value = value_at(whole, path)
    values: dict[str, Any] = {"missing": MISSING, "wrong type": 7 if isinstance(value, str) else "many"}
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        values |= {"NaN": math.nan, "infinite": math.inf, "huge": 1e300}
        if isinstance(path[-1], str):  # a component of a vector may be any number
            values |= {"negative": -abs(value) or -1.0, "zero": 0.0, "tiny": 1e-300}
    return {kind: (changed(whole, path, each), kind in valid) for kind, each in values.items()}


@dataclass(frozen=True)
class Row:
    """A command that has to be refused, what its message says, and what is in the folder that it is given in.

    `scene` is written to scene.toml, `files` (name to text or bytes) besides; `setup` names a function of the test.
    """

    area: str
    what: str
    args: tuple[str, ...]
    words: tuple[str, ...]
    scene: dict[str, Any] | str | bytes | None = None
    files: dict[str, str | bytes] = field(default_factory=dict)


RUN = ("run", "scene.toml", "--arch", "cpu", "--output-dir", "out")
DAM = ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "out")


def scene(what: str, data: Any, *words: str) -> Row:
    return Row("scene", what, RUN, words, data)


def with_parts(base: dict[str, Any], **parts: Any) -> dict[str, Any]:
    return {**base, **parts}


TANK = {
    "domain": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]},
    "spacing": 0.1,
    "fluids": [{"lower": [0.0, 0.0], "upper": [0.5, 0.5]}],
}
BOX = {
    "domain": {"lower": [0.0, 0.0, 0.0], "upper": [1.0, 1.0, 1.0]},
    "spacing": 0.1,
    "fluids": [{"lower": [0.0, 0.0, 0.0], "upper": [0.5, 0.5, 0.5]}],
}


def block(lower: Any, upper: Any, **more: Any) -> dict[str, Any]:
    return {"lower": lower, "upper": upper, **more}


def mesh(file: str) -> dict[str, Any]:
    return with_parts(BOX, obstacles=[{"shape": "mesh", "file": file, "scale": 0.3, "translation": [0.6, 0.1, 0.1]}])


SCENES = [
    scene("block outside the domain", with_parts(TANK, fluids=[block([0.0, 0.0], [1.5, 0.5])]), "fluids.0", "leaves the domain", "move or shrink"),
    scene("blocks overlapping", with_parts(TANK, fluids=[block([0.0, 0.0], [0.5, 0.5]), block([0.4, 0.4], [1.0, 1.0])]), "fluids.1: overlaps fluids.0", "move one"),
    scene("block inside out", with_parts(TANK, fluids=[block([0.5, 0.5], [0.0, 0.0])]), "must exceed lower"),
    scene("spacing larger than a block", with_parts(TANK, spacing=0.6), "exceeds the shortest edge 0.5", "use at most 0.5"),
    scene("spacing of 1e-7: too many particles for 32 bits", with_parts(BOX, spacing=1e-7), "32 bits", "2147483647", "use a spacing of at least"),
    scene("the same with an obstacle and a wrong gravity", with_parts(BOX, spacing=1e-7, gravity=[0.0, 1.0], obstacles=[{"shape": "sphere", "centre": [0.7, 0.7, 0.7], "radius": 0.2}]), "32 bits"),
    scene("fits 32 bits, not the memory", with_parts(BOX, spacing=4.5e-4), "of memory", "are free", "use a spacing of at least"),
    scene("a domain of too many cells", with_parts(TANK, domain=block([0.0, 0.0], [1e7, 1e7])), "cells of the grid", "use a spacing of at least"),
    scene("a domain far from the origin", with_parts(TANK, domain=block([1e7, 0.0], [1e7 + 1.0, 1.0]), fluids=[block([1e7, 0.0], [1e7 + 0.5, 0.5])]), "from the origin", "move it to the origin"),
    scene("no fluid", with_parts(TANK, fluids=[]), "fluids", "at least 1"),
    scene("2,000 blocks", with_parts(TANK, fluids=[block([0.0, 0.0], [0.5, 0.5])] * 2000), "fluids", "at most 1000"),
    scene("one dimension", with_parts(TANK, domain=block([0.0], [1.0])), "domain.lower", "at least 2"),
    scene("four dimensions", with_parts(TANK, domain=block([0.0] * 4, [1.0] * 4)), "domain.lower", "at most 3"),
    scene("mixed dimensions", with_parts(TANK, fluids=[block([0.0] * 3, [0.5] * 3)]), "has 3 components; the domain has 2"),
    scene("gravity of another dimension", with_parts(TANK, gravity=[0.0, 0.0, -9.81]), "has 3 components; the domain has 2"),
    scene("unknown key", with_parts(TANK, spacin=1.0), "spacin: unknown key", "did you mean 'spacing'"),
    scene("a number with a unit", with_parts(TANK, spacing="0.1 m"), "spacing", "valid number", "0.1 m"),
    scene("a number in quotes", with_parts(TANK, spacing="0.1"), "spacing", "valid number"),
    scene("true for a number", with_parts(TANK, spacing=True), "spacing", "valid number"),
    scene("sound speed below half of the speeds", with_parts(TANK, sound_speed=0.5), "sound_speed: 0.5 m/s is too little", "use at least 1.57, better 31.3"),
    scene("gravity beyond any flow", with_parts(TANK, gravity=[0.0, -1e9], sound_speed=1e4), "is too little for fluid"),
    scene("velocity beyond any flow", with_parts(TANK, fluids=[block([0.0, 0.0], [0.5, 0.5], velocity=[1e11, 0.0])]), "single precision"),
    scene("nothing moves, no sound speed", with_parts(TANK, gravity=[0.0, 0.0]), "nothing falls or moves", "give it a value"),
    scene("a column compressed by its weight too much", with_parts(TANK, hydrostatic=True, sound_speed=4.0), "hydrostatic", "use a sound_speed of at least"),
    scene("a pressure above the stiffness", with_parts(TANK, background_pressure=1e9), "background_pressure", "lower it"),
    scene("end in the year 30000", with_parts(TANK, end_time=1e12), "frames", "end earlier"),
    scene("a viscosity that takes too short steps", with_parts(TANK, kinematic_viscosity=1e9), "ticks", "a smaller viscosity"),
    scene("inflow that stops before it starts", with_parts(TANK, inflows=[{"lower": [0.0, 0.7], "upper": [0.0, 0.9], "velocity": [1.0, 0.0], "start": 0.5, "stop": 0.2}]), "stop 0.2 must exceed start 0.5"),
    scene("inflow of more than 32 bits", with_parts(TANK, end_time=1e4, inflows=[{"lower": [0.0, 0.7], "upper": [0.0, 0.9], "velocity": [1e6, 0.0]}]), "32 bits"),
    scene("times that descend", with_parts(TANK, moving_walls=[{"face": "x+", "times": [0.5, 0.0], "displacements": [0.0, -0.1]}]), "must ascend"),
    scene("a piston that closes the domain", with_parts(TANK, moving_walls=[{"face": "x+", "times": [0.0, 1.0], "displacements": [0.0, -1.0]}]), "would close the domain"),
    scene("a piston as fast as light", with_parts(TANK, sound_speed=40.0, moving_walls=[{"face": "x+", "times": [0.0, 1e-10], "displacements": [0.0, -0.1]}]), "too little for fluid", "pushed"),
    scene("a face that does not exist", with_parts(TANK, moving_walls=[{"face": "z+", "times": [0.0, 1.0], "displacements": [0.0, -0.1]}]), "no wall 'z+'"),
    scene("a periodic axis that does not exist", with_parts(TANK, periodic=["z"]), "axis 'z' does not exist"),
    scene("probe outside the domain", with_parts(TANK, probes=[{"position": [2.0, 0.1]}]), "outside the domain", "move it"),
    scene("two probes of one name", with_parts(TANK, probes=[{"position": [0.1, 0.1], "name": "a"}, {"position": [0.2, 0.1], "name": "a"}]), "the name 'a'", "rename one"),
    scene("obstacle outside the domain", with_parts(TANK, obstacles=[{"shape": "sphere", "centre": [5.0, 5.0], "radius": 0.2}]), "outside the domain", "move it"),
    scene("obstacle thinner than the spacing", with_parts(TANK, obstacles=[{"shape": "box", "lower": [0.6, 0.0], "upper": [0.61, 0.5]}]), "thin", "use a spacing of at most"),
    scene("obstacle of an unknown shape", with_parts(TANK, obstacles=[{"shape": "cone"}]), "shape", "choose one of"),
    scene("fluid inside an obstacle", with_parts(TANK, obstacles=[{"shape": "box", "lower": [0.0, 0.0], "upper": [0.6, 0.6]}]), "lies wholly inside obstacles.0"),
    scene("mesh open", mesh("open.obj"), "is open", "close its holes"),
    scene("mesh missing", mesh("none.obj"), "does not exist", "check the path"),
    scene("mesh inside out", mesh("inside_out.obj"), "inside out", "flip its normals"),
    scene("mesh of an unknown format", mesh("drops.csv"), "no OBJ, STL or PLY", "convert it"),
    scene("mesh that is something else", mesh("broken.obj"), "broken.obj", "export"),
    scene("mesh that is a folder", mesh("folder.obj"), "does not exist", "check the path"),
    scene("mesh above the scene's folder", mesh("../../solid.obj"), "leaves the scene's folder", "put it there"),
    scene("mesh by an absolute path", mesh("/etc/passwd"), "leaves the scene's folder", "put it there"),
    scene("mesh by a link out of the folder", mesh("link.obj"), "leaves the scene's folder", "put it there"),
    scene("mesh with a zero byte in its name", mesh("a\0b.obj"), "leaves the scene's folder"),
    scene("particles missing", with_parts(BOX, fluids=[{"file": "none.csv"}]), "cannot be read", "check the path"),
    scene("particles above the scene's folder", with_parts(BOX, fluids=[{"file": "../drops.csv"}]), "leaves the scene's folder"),
    scene("particles of an unknown format", with_parts(BOX, fluids=[{"file": "solid.obj"}]), "known suffixes", "convert it"),
    scene("particles that are not numbers", with_parts(BOX, fluids=[{"file": "nan.csv"}]), "finite numbers are needed"),
    scene("a pickle that says it is an npz", with_parts(BOX, fluids=[{"file": "pickle.npz"}]), "not a whole .npz file"),
    scene("an npz that unpacks to 1 TiB", with_parts(BOX, fluids=[{"file": "bomb.npz"}]), "not a whole .npz file", "unpack"),
    scene("a bgeo that unpacks to 1 GiB", with_parts(BOX, fluids=[{"file": "bomb.bgeo"}]), "not a whole .bgeo file", "unpack"),
    scene("a ply of 1e12 particles in 100 bytes", with_parts(BOX, fluids=[{"file": "lying.ply"}]), "not a whole .ply file"),
    scene("a vtu with entities", with_parts(BOX, fluids=[{"file": "laughs.vtu"}]), "not a whole .vtu file"),
    scene("a name that is a path", with_parts(TANK, name="../../etc/cron.d/x"), "name", "pattern"),
    scene("no TOML", "spacing = = 1", "not valid TOML"),
    scene("not even text", b"\xff\xfe\x00", "not valid TOML"),
    scene("empty", "", "domain: missing", "fluids: missing"),
    scene("nested 100,000 times", "a = " + "[" * 100_000, "not valid TOML"),
    scene("2 MiB long", "# " + "x" * (2 << 20), "is longer than 1048576 bytes"),
    scene("a key twice", "spacing = 1\nspacing = 2\n", "not valid TOML"),
]  # fmt: skip


def command(what: str, args: tuple[str, ...], *words: str, **more: Any) -> Row:
    return Row("command line", what, args, words, **more)


def options(*args: str) -> tuple[str, ...]:
    return (*DAM, *args)


NUMBERS = ("--courant", "--alpha", "--lambda-f", "--spacing", "--end-time", "--export-fps", "--checkpoint-every")
BAD_NUMBERS = {"wrong type": "many", "NaN": "nan", "infinite": "inf", "negative": "-1", "zero": "0", "huge": "1e300", "tiny": "1e-300"}  # fmt: skip
VALID_OPTIONS = {("--checkpoint-every", "huge")}
"""A checkpoint at the end only."""

COMMANDS = [
    *(
        command(f"{option} {kind}", options("--stepper", "regional", option, value), option.strip("-").split("-")[0])
        for option in NUMBERS
        for kind, value in BAD_NUMBERS.items()
        if (option, kind) not in VALID_OPTIONS
    ),
    *(
        command(f"--sound-speed {kind}", options("--sound-speed", value), "sound")
        for kind, value in BAD_NUMBERS.items()
    ),
    *(
        command(f"{option} {value}", options(option, value), option.strip("-"))
        for option in ("--azimuth", "--elevation")
        for value in ("many", "nan", "inf", "1e300", "-400")
    ),
    *(
        command(f"{option} {value}", options(option, value), "picture" if value[-1].isdigit() else option)
        for option in ("--width", "--height")
        for value in ("many", "nan", "0", "-5", "100000")
    ),
    *(command(f"--levels {value}", options("--levels", value), "levels") for value in ("0", "-1", "1.5", "many", "100000")),
    *(command(f"--particles {value}", options("--particles", value), value, "30k") for value in ("many", "nan", "0", "-5", "1e12")),
    command("more particles than memory", options("--particles", "2000M"), "of memory", "are free", "use a spacing of at least"),
    command("λ of 50", options("--courant", "50"), "courant", "less than or equal to 2", "50"),
    command("levels of no power of two", options("--stepper", "asynchronous", "--levels", "6"), "levels 6", "use 4 or 8"),
    command("--stagger -1", options("--stepper", "asynchronous", "--stagger", "-1"), "stagger"),
    command("--stagger 1e10", options("--stepper", "asynchronous", "--stagger", "10000000000"), "stagger"),
    command("option of another stepper", options("--stepper", "uniform", "--levels", "3"), "--levels", "uniform"),
    command("panels and a stepper", options("--panels", "steppers", "--stepper", "uniform"), "--panels steppers", "leave out"),
    command("spacing and particles", options("--spacing", "0.1", "--particles", "1k"), "both given"),
    command("spacing larger than a block", options("--spacing", "2"), "exceeds the shortest edge"),
    command("end before a frame", options("--export-fps", "1e7"), "export_fps"),
    command("too many frames", options("--end-time", "2", "--export-fps", "1e6"), "frames", "use an export_fps of at most"),
    command("too many checkpoints", options("--checkpoint-every", "1e-9"), "checkpoints", "use at least"),
    command("unknown scene", ("run", "no_such_scene"), "no_such_scene", "choose one of"),
    command("missing scene file", ("run", "none.toml"), "none.toml", "check the path"),
    command("scene file that is a folder", ("run", "folder.toml"), "folder.toml", "check the path"),
    command("unknown extension", ("run", "scene.yaml"), "scene.yaml", "name a .toml file"),
    command("unknown option", options("--nonsense"), "nonsense"),
    command("unknown command", ("jump",), "jump"),
    command("unknown stepper", options("--stepper", "leapfrog"), "leapfrog"),
    command("unknown arch", options("--arch", "tpu"), "tpu"),
    command("arch missing", ("run", "dam_break_2d", "--arch", "cuda", "--output-dir", "out"), "cuda", "use --arch cpu"),
    command("unknown precision", options("--precision", "f16"), "f16"),
    command("unknown colours", options("--colour-by", "age"), "age"),
    command("unknown format", options("--export", "vtk"), "'vtk' is no format", "did you mean 'vtu'"),
    command("unknown attribute", options("--export", "vtu", "--attributes", "mood"), "'mood' is no attribute"),
    command("attributes of nothing", options("--attributes", "id"), "nothing is exported"),
    command("surface in two dimensions", options("--export", "surface"), "3 dimensions", "leave it out"),
    command("video without pictures", options("--no-frames", "--video"), "--no-frames", "leave out one"),
    command("window and debug", options("--gui", "--debug"), "--gui", "leave out"),
    command("output exists", ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "earlier"), "already holds a run", "--overwrite"),
    command("output is a file", ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "drops.csv"), "is a file", "choose another"),
    command("output below a file", ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "drops.csv/out"), "drops.csv", "choose another"),
    command("no write permission", ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "/proc/out"), "/proc/out", "choose another"),
    command("resume of nothing", ("run", "--resume", "none.npz"), "none.npz", "check the path"),
    command("resume of another file", ("run", "--resume", "drops.csv"), "drops.csv", "use another checkpoint"),
    command("resume of a folder without checkpoints", ("run", "--resume", "earlier"), "no whole checkpoint", "start the run again"),
    command("compare: no such stepper", ("compare", "--steppers", "leapfrog", "--output-dir", "out"), "leapfrog"),
    command("compare: courants", ("compare", "--courants", "0.4,many", "--output-dir", "out"), "many"),
    command("compare: courant NaN", ("compare", "--courants", "nan", "--output-dir", "out"), "nan"),
    command("compare: 0 samples", ("compare", "--samples", "0", "--output-dir", "out"), "samples"),
    command("compare: 0 repeats", ("compare", "--repeats", "0", "--output-dir", "out"), "repeats"),
    command("compare: 0 workers", ("compare", "--workers", "0", "--output-dir", "out"), "workers"),
    command("compare: end NaN", ("compare", "--end-time", "nan", "--output-dir", "out"), "end_time"),
    command("compare: output is a file", ("compare", "--output-dir", "drops.csv"), "is a file", "choose another"),
    command("stability: no such case", ("stability", "--cases", "calm", "--output-dir", "out"), "calm"),
    command("stability: tolerance NaN", ("stability", "--tolerance", "nan", "--output-dir", "out"), "tolerance"),
    command("stability: 0 workers", ("stability", "--workers", "0", "--output-dir", "out"), "workers"),
    command("stability: output is a file", ("stability", "--output-dir", "drops.csv"), "is a file", "choose another"),
]  # fmt: skip


def prepare(folder: Path, row: Row) -> None:
    """Fill `folder` with what the row's command finds there."""
    if isinstance(row.scene, dict):
        (folder / "scene.toml").write_text(to_toml(row.scene), encoding="utf-8")
    elif row.scene is not None:
        (folder / "scene.toml").write_bytes(row.scene.encode() if isinstance(row.scene, str) else row.scene)
    for name, content in row.files.items():
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)


def facts(row: Row) -> str:
    """Return what a row's scene changes, for messages."""
    return json.dumps(row.scene, default=str)[:200] if isinstance(row.scene, dict) else str(row.args)
