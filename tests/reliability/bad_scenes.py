"""Scene files in which fields contradict each other, name what is not there, or are no scene files."""

from typing import Any

from rows import RUN, Row


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
    scene(
        "block outside the domain",
        with_parts(TANK, fluids=[block([0.0, 0.0], [1.5, 0.5])]),
        "fluids.0: block from (0.0, 0.0) to (1.5, 0.5) leaves the domain from (0.0, 0.0) to (1.0, 1.0)",
        "move or shrink it, or enlarge the domain",
    ),
    scene(
        "blocks overlapping",
        with_parts(TANK, fluids=[block([0.0, 0.0], [0.5, 0.5]), block([0.4, 0.4], [1.0, 1.0])]),
        "fluids.1: overlaps fluids.0",
        "move one",
    ),
    scene("block inside out", with_parts(TANK, fluids=[block([0.5, 0.5], [0.0, 0.0])]), "must exceed lower"),
    scene(
        "spacing larger than a block",
        with_parts(TANK, spacing=0.6),
        "spacing: 0.6 exceeds the shortest edge 0.5 of fluids.0; use at most 0.5",
    ),
    scene(
        "spacing of 1e-7: too many particles for 32 bits",
        with_parts(BOX, spacing=1e-7),
        "32 bits",
        "2147483647",
        "use a spacing of at least",
    ),
    scene(
        "the same with an obstacle and a wrong gravity",
        with_parts(
            BOX,
            spacing=1e-7,
            gravity=[0.0, 1.0],
            obstacles=[{"shape": "sphere", "centre": [0.7, 0.7, 0.7], "radius": 0.2}],
        ),
        "32 bits",
    ),
    scene(
        "fits 32 bits, not the memory",
        with_parts(BOX, spacing=6e-4),
        "of memory",
        "are free",
        "use a spacing of at least",
    ),
    scene(
        "a domain of too many cells",
        with_parts(TANK, domain=block([0.0, 0.0], [1e7, 1e7])),
        "cells of the grid",
        "use a spacing of at least",
    ),
    scene(
        "a domain farther from 0 than doubles tell apart",
        with_parts(TANK, domain=block([1e12 - 1.0, 0.0], [1e12, 1.0]), fluids=[block([1e12 - 1.0, 0.0], [1e12, 0.5])]),
        "m from 0, where numbers in double precision are rounded by",
        "move it towards 0",
    ),
    scene(
        "a domain too long for single precision",
        with_parts(TANK, domain=block([0.0, 0.0], [1e4, 1.0])),
        "where f32 rounds them by",
        "use --precision f64",
    ),
    scene("no fluid", with_parts(TANK, fluids=[]), "fluids", "at least 1"),
    scene("2,000 blocks", with_parts(TANK, fluids=[block([0.0, 0.0], [0.5, 0.5])] * 2000), "fluids", "at most 1000"),
    scene("one dimension", with_parts(TANK, domain=block([0.0], [1.0])), "domain.lower", "at least 2"),
    scene("four dimensions", with_parts(TANK, domain=block([0.0] * 4, [1.0] * 4)), "domain.lower", "at most 3"),
    scene(
        "mixed dimensions",
        with_parts(TANK, fluids=[block([0.0] * 3, [0.5] * 3)]),
        "fluids.0: has 3 components; the domain has 2",
    ),
    scene(
        "gravity of another dimension",
        with_parts(TANK, gravity=[0.0, 0.0, -9.81]),
        "gravity (0.0, 0.0, -9.81) has 3 components; the domain has 2",
    ),
    scene("unknown key", with_parts(TANK, spacin=1.0), "spacin: unknown key", "did you mean 'spacing'"),
    scene(
        "a number with a unit",
        with_parts(TANK, spacing="0.1 m"),
        "spacing: '0.1 m' is a text; give a plain number in SI units, 0.1",
    ),
    scene("a number in quotes", with_parts(TANK, spacing="0.1"), "spacing", "valid number"),
    scene("true for a number", with_parts(TANK, spacing=True), "spacing", "valid number"),
    scene(
        "sound speed below half of the speeds",
        with_parts(TANK, sound_speed=0.5),
        "sound_speed: 0.5 m/s is too little",
        "use at least 1.57, better 31.3",
    ),
    scene("gravity beyond any flow", with_parts(TANK, gravity=[0.0, -1e9], sound_speed=1e4), "is too little for fluid"),
    scene(
        "velocity beyond any flow",
        with_parts(TANK, fluids=[block([0.0, 0.0], [0.5, 0.5], velocity=[1e11, 0.0])]),
        "single precision",
    ),
    scene(
        "nothing moves, no sound speed",
        with_parts(TANK, gravity=[0.0, 0.0]),
        "sound_speed: nothing falls or moves",
        "give it a value",
    ),
    scene(
        "a column compressed by its weight too much",
        with_parts(TANK, hydrostatic=True, sound_speed=4.0),
        "hydrostatic",
        "use a sound_speed of at least",
    ),
    scene(
        "a pressure above the stiffness", with_parts(TANK, background_pressure=1e9), "background_pressure", "lower it"
    ),
    scene("end in the year 30000", with_parts(TANK, end_time=1e12), "frames", "end earlier"),
    scene("a viscosity that takes too short steps", with_parts(TANK, kinematic_viscosity=1e9), "ticks", "viscosity"),
    scene(
        "inflow that stops before it starts",
        with_parts(
            TANK,
            inflows=[{"lower": [0.0, 0.7], "upper": [0.0, 0.9], "velocity": [1.0, 0.0], "start": 0.5, "stop": 0.2}],
        ),
        "stop 0.2 must exceed start 0.5",
    ),
    scene(
        "inflow of more than 32 bits",
        with_parts(TANK, end_time=1e4, inflows=[{"lower": [0.0, 0.7], "upper": [0.0, 0.9], "velocity": [1e6, 0.0]}]),
        "32 bits",
    ),
    scene(
        "times that descend",
        with_parts(TANK, moving_walls=[{"face": "x+", "times": [0.5, 0.0], "displacements": [0.0, -0.1]}]),
        "times (0.5, 0.0) must ascend",
    ),
    scene(
        "a piston that closes the domain",
        with_parts(TANK, moving_walls=[{"face": "x+", "times": [0.0, 1.0], "displacements": [0.0, -1.0]}]),
        "moving_walls.0: 'x+' would close the domain",
    ),
    scene(
        "a piston as fast as light",
        with_parts(
            TANK, sound_speed=40.0, moving_walls=[{"face": "x+", "times": [0.0, 1e-10], "displacements": [0.0, -0.1]}]
        ),
        "too little for fluid",
        "pushed",
    ),
    scene(
        "a face that does not exist",
        with_parts(TANK, moving_walls=[{"face": "z+", "times": [0.0, 1.0], "displacements": [0.0, -0.1]}]),
        "no wall 'z+'",
    ),
    scene(
        "a face that moves by nothing",
        with_parts(TANK, moving_walls=[{"face": "x+"}]),
        "moves nothing; give times [s] and displacements [m], or velocity [m/s]",
    ),
    scene(
        "a face that slides out of its plane",
        with_parts(TANK, kinematic_viscosity=0.1, moving_walls=[{"face": "x+", "velocity": [0.1, 1.0]}]),
        "velocity (0.1, 1.0) leads across face 'x+'",
    ),
    scene(
        "a face that slides without friction",
        with_parts(TANK, moving_walls=[{"face": "x+", "velocity": [0.0, 1.0]}]),
        "moving_walls.0: face 'x+' slides by friction alone, and kinematic_viscosity is 0",
    ),
    scene(
        "a face that slides in another dimension",
        with_parts(TANK, kinematic_viscosity=0.1, moving_walls=[{"face": "x+", "velocity": [0.0, 1.0, 0.0]}]),
        "moving_walls.0: velocity has 3 components; the domain has 2",
    ),
    scene(
        "a moving body that meets its own image",
        with_parts(
            TANK,
            periodic=["x"],
            obstacles=[{"shape": "box", "lower": [0.1, 0.2], "upper": [0.9, 0.4], "motion": {"velocity": [1.0, 0.0]}}],
        ),
        "from its pivot along the periodic axis 'x'",
        "half the domain's length less a support radius",
    ),
    scene(
        "a periodic axis that does not exist",
        with_parts(TANK, periodic=["z"]),
        "periodic: axis 'z' does not exist in two dimensions",
    ),
    scene(
        "probe outside the domain", with_parts(TANK, probes=[{"position": [2.0, 0.1]}]), "outside the domain", "move it"
    ),
    scene(
        "two probes of one name",
        with_parts(TANK, probes=[{"position": [0.1, 0.1], "name": "a"}, {"position": [0.2, 0.1], "name": "a"}]),
        "the name 'a'",
        "rename one",
    ),
    scene(
        "obstacle outside the domain",
        with_parts(TANK, obstacles=[{"shape": "sphere", "centre": [5.0, 5.0], "radius": 0.2}]),
        "sphere from (4.8, 4.8) to (5.2, 5.2) lies outside the domain from (0, 0) to (1, 1)",
        "move it",
    ),
    scene(
        "obstacle thinner than the spacing",
        with_parts(TANK, obstacles=[{"shape": "box", "lower": [0.6, 0.0], "upper": [0.61, 0.5]}]),
        "is 0.01 m thin, the spacing 0.1; use a spacing of at most 0.01",
    ),
    scene(
        "obstacle of an unknown shape",
        with_parts(TANK, obstacles=[{"shape": "cone"}]),
        "shape is missing or unknown",
        "one of box, sphere",
    ),
    scene(
        "fluid inside an obstacle",
        with_parts(TANK, obstacles=[{"shape": "box", "lower": [0.0, 0.0], "upper": [0.6, 0.6]}]),
        "fluids.0: lies wholly inside obstacles.0; move or shrink one",
    ),
    scene("mesh open", mesh("open.obj"), "obstacles.0: ", "is open: 3 of its edges", "close its holes"),
    scene("mesh missing", mesh("none.obj"), "does not exist", "check the path"),
    scene(
        "mesh inside out",
        mesh("inside_out.obj"),
        "obstacles.0: ",
        "is inside out: its volume is -",
        "flip its normals",
    ),
    scene("mesh of an unknown format", mesh("drops.csv"), "no OBJ, STL or PLY", "convert it"),
    scene("mesh that is something else", mesh("broken.obj"), "broken.obj", "export"),
    scene("mesh that is a folder", mesh("folder.obj"), "does not exist", "check the path"),
    scene("mesh above the scene's folder", mesh("../../solid.obj"), "leaves the scene's folder", "put it there"),
    scene("mesh by an absolute path", mesh("/etc/passwd"), "leaves the scene's folder", "put it there"),
    scene("mesh by a link out of the folder", mesh("link.obj"), "leaves the scene's folder", "put it there"),
    scene("mesh with a zero byte in its name", mesh("a\0b.obj"), "leaves the scene's folder"),
    scene(
        "particles missing",
        with_parts(BOX, fluids=[{"file": "none.csv"}]),
        "fluids.0: particle file ",
        "none.csv' cannot be read",
        "check the path",
    ),
    scene(
        "particles above the scene's folder",
        with_parts(BOX, fluids=[{"file": "../drops.csv"}]),
        "fluids.0.file: ",
        "leaves the scene's folder",
    ),
    scene(
        "particles by an absolute path",
        with_parts(BOX, fluids=[{"file": "/etc/drops.csv"}]),
        "fluids.0.file: ",
        "leaves the scene's folder",
    ),
    scene(
        "particles of an unknown format",
        with_parts(BOX, fluids=[{"file": "solid.obj"}]),
        "known suffixes",
        "convert it",
    ),
    scene("particles that are not numbers", with_parts(BOX, fluids=[{"file": "nan.csv"}]), "finite numbers are needed"),
    scene("a pickle that says it is an npz", with_parts(BOX, fluids=[{"file": "pickle.npz"}]), "not a whole .npz file"),
    scene(
        "an npz that unpacks to 1 TiB",
        with_parts(BOX, fluids=[{"file": "bomb.npz"}]),
        "not a whole .npz file",
        "unpack",
    ),
    scene(
        "a bgeo that unpacks to 1 GiB",
        with_parts(BOX, fluids=[{"file": "bomb.bgeo"}]),
        "not a whole .bgeo file",
        "unpack",
    ),
    scene(
        "a ply of 1e12 particles in 100 bytes", with_parts(BOX, fluids=[{"file": "lying.ply"}]), "not a whole .ply file"
    ),
    scene("a vtu with entities", with_parts(BOX, fluids=[{"file": "laughs.vtu"}]), "not a whole .vtu file"),
    scene("a name that is a path", with_parts(TANK, name="../../etc/cron.d/x"), "name", "pattern"),
    scene("no TOML", "spacing = = 1", "not valid TOML"),
    scene("not even text", b"\xff\xfe\x00", "not valid TOML"),
    scene("empty", "", "domain: missing", "fluids: missing"),
    scene("nested 100,000 times", "a = " + "[" * 100_000, "not valid TOML"),
    scene("2 MiB long", "# " + "x" * (2 << 20), "is longer than 1048576 bytes"),
    scene("a key twice", "spacing = 1\nspacing = 2\n", "not valid TOML"),
]
