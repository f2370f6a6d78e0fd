"""Scene files for tests of bad input: whole ones that use every feature, how to write them as TOML, how to spoil them."""

import copy
import json
import math
from typing import Any

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
OPEN = TETRAHEDRON.replace("f 3 1 4\n", "")
INSIDE_OUT = TETRAHEDRON.replace("f 1 3 2", "f 1 2 3").replace("f 1 2 4", "f 1 4 2")
INSIDE_OUT = INSIDE_OUT.replace("f 2 3 4", "f 2 4 3").replace("f 3 1 4", "f 3 4 1")
PARTICLES = "x,y,z\n1.75,0.25,0.25\n1.85,0.25,0.25\n"

SOLID: dict[str, Any] = {
    "domain": {"lower": [0.0, 0.0, 0.0], "upper": [2.0, 1.0, 1.0]},
    "spacing": 0.1,
    "gravity": [0.0, -9.81, 0.0],
    "gravity_changes": [{"time": 0.5, "gravity": [1.0, -9.81, 0.0]}],
    "gravity_interpolation": "linear",
    "body_force": {
        "gradient": [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]],
        "value": [0.1, 0.0, 0.0],
        "origin": [0.5, 0.5, 0.5],
    },
    "sound_speed": 40.0,
    "density": "summation",
    "background_pressure": 10.0,
    "kernel": "cubic_spline",
    "support_ratio": 2.0,
    "rest_density": 1000.0,
    "artificial_viscosity": 0.08,
    "kinematic_viscosity": 1e-6,
    "hydrostatic": False,
    "walls": True,
    "periodic": [],
    "end_time": 1.0,
    "name": "whole",
    "description": "Everything that a scene can have in three dimensions.",
    "fluids": [
        {
            "lower": [0.0, 0.0, 0.0],
            "upper": [0.4, 0.5, 1.0],
            "velocity": [0.1, 0.0, 0.0],
            "kinematic_viscosity": 1e-6,
        },
        {"centre": [0.8, 0.7, 0.5], "radius": 0.2, "velocity": {"gradient": [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]}},
        {"file": "drops.csv"},
    ],
    "moving_walls": [{"face": "x+", "times": [0.0, 0.5], "displacements": [0.0, -0.1]}],
    "inflows": [
        {"lower": [0.0, 0.6, 0.3], "upper": [0.0, 0.9, 0.6], "velocity": [1.0, 0.0, 0.0], "start": 0.1, "stop": 0.2}
    ],
    "probes": [{"position": [0.1, 0.1, 0.1], "name": "corner"}],
    "gauges": [{"position": [0.2, 0.1, 0.1], "name": "left"}],
    "obstacles": [
        {
            "shape": "box",
            "lower": [1.1, 0.0, 0.1],
            "upper": [1.3, 0.3, 0.3],
            "rotation": [0.0, 30.0, 0.0],
            "motion": {
                "velocity": [0.0, 0.1, 0.0],
                "angular_velocity": [0.0, 1.0, 0.0],
                "pivot": [1.2, 0.1, 0.2],
                "start": 0.1,
                "stop": 0.2,
            },
        },
        {
            "shape": "sphere",
            "centre": [1.5, 0.8, 0.5],
            "radius": 0.15,
            "motion": {
                "times": [0.0, 0.5],
                "displacements": [[0.0, 0.0, 0.0], [0.0, 0.1, 0.0]],
                "rotations": [[0.0, 0.0, 0.0], [0.0, 90.0, 0.0]],
                "pivot": [1.5, 0.8, 0.5],
            },
        },
        {"shape": "cylinder", "start": [1.2, 0.6, 0.5], "end": [1.2, 0.9, 0.5], "radius": 0.15},
        {
            "shape": "mesh",
            "file": "solid.obj",
            "scale": 0.4,
            "rotation": [0.0, 0.0, 0.0],
            "translation": [1.4, 0.1, 0.4],
        },
    ],
    "view": {
        "azimuth": -35.0,
        "elevation": 20.0,
        "eye": [3.0, 2.0, 4.0],
        "target": [0.5, 0.5, 0.5],
        "zoom": 1.0,
    },
}
"""A scene in three dimensions; `FILES` are those that it names."""

FLAT: dict[str, Any] = {
    "domain": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]},
    "spacing": 0.1,
    "sound_speed": {"mach": 0.1, "memory": 40.0, "floor": 5.0, "cap": 40.0},
    "fluids": [
        {
            "lower": [0.0, 0.0],
            "upper": [1.0, 0.5],
            "velocity": {"speed": 0.1, "wavelength": 1.0, "depth": 0.5, "origin": [0.0, 0.0]},
        },
        {"lower": [0.0, 0.5], "upper": [1.0, 0.6], "velocity": {"speed": 0.1, "wavelength": 1.0, "origin": [0.5, 0.5]}},
    ],
    "obstacles": [{"shape": "polygon", "points": [[0.6, 0.7], [0.9, 0.7], [0.9, 0.9]]}],
}
"""One in two dimensions, with what three have not."""

FOREIGN: dict[str, Any] = {
    "Configuration": {
        "particleRadius": 0.05,
        "gravitation": [0.0, -9.81, 0.0],
        "sim2D": False,
        "stopAt": 1.5,
        "pauseAt": -1.0,
        "timeStepSize": 0.002,
        "cflMethod": 1,
        "cflFactor": 0.5,
        "cflMaxTimeStepSize": 0.005,
        "simulationMethod": 0,
        "kernel": 1,
        "cameraPosition": [0.0, 2.0, 5.0],
        "cameraLookat": [0.0, 0.5, 0.0],
    },
    "Materials": [
        {"id": "Fluid", "density0": 1000.0, "viscosity": 0.01, "viscosityMethod": 1, "surfaceTensionMethod": 0},
        {"id": "oil", "density0": 1000.0, "viscosityMethod": 6, "Weiler et al. 2018": {"viscosity": 0.1}},
    ],
    "RigidBodies": [
        {
            "id": 1,
            "geometryFile": "cube.obj",
            "translation": [0.0, 1.0, 0.0],
            "rotationAxis": [0.0, 1.0, 0.0],
            "rotationAngle": 0.0,
            "scale": [2.0, 2.0, 1.0],
            "isWall": True,
            "mapInvert": True,
        },
        {
            "geometryFile": "solid.obj",
            "translation": [0.4, 0.1, 0.0],
            "rotationAxis": [0.0, 1.0, 0.0],
            "rotationAngle": 0.5,
            "scale": [0.3, 0.3, 0.3],
            "isDynamic": False,
            "isAnimated": False,
            "isWall": False,
        },
    ],
    "FluidBlocks": [
        {
            "id": "Fluid",
            "start": [-0.5, 0.0, -0.5],
            "end": [0.5, 1.0, 0.5],
            "translation": [-0.5, 0.0, 0.0],
            "scale": [0.8, 1.0, 1.0],
            "denseMode": 0,
            "initialVelocity": [0.1, 0.0, 0.0],
            "initialAngularVelocity": [0.0, 0.0, 0.1],
        }
    ],
    "FluidModels": [
        {"id": "oil", "particleFile": "drops.csv", "translation": [-1.2, 1.0, -0.3], "initialVelocity": [0.0, 0.0, 0.0]}
    ],
    "Emitters": [
        {
            "width": 3,
            "height": 3,
            "translation": [-0.9, 1.6, 0.0],
            "rotationAxis": [0.0, 1.0, 0.0],
            "rotationAngle": 0.0,
            "velocity": 1.0,
            "type": 0,
            "emitStartTime": 0.1,
            "emitEndTime": 0.5,
        }
    ],
}
"""One of SPlisHSPlasH, with all that is read of its format."""

CUBE = "".join(f"v {x} {y} {z}\n" for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)) + (
    "f 1 2 4\nf 1 4 3\nf 5 7 8\nf 5 8 6\nf 1 5 6\nf 1 6 2\nf 3 4 8\nf 3 8 7\nf 1 3 7\nf 1 7 5\nf 2 6 8\nf 2 8 4\n"
)
FILES = {
    "cube.obj": CUBE,
    "drops.csv": PARTICLES,
    "solid.obj": TETRAHEDRON,
    "open.obj": OPEN,
    "inside_out.obj": INSIDE_OUT,
}

Path = tuple[str | int, ...]
"""Keys and numbers that lead to a value of a scene."""


def to_toml(data: dict[str, Any]) -> str:
    """Return `data` as TOML, a line for each key."""
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in data.items())


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    return json.dumps(value)


def _key(key: str) -> str:
    return json.dumps(key)


def paths(data: Any, so_far: Path = ()) -> list[Path]:
    """Return the paths of all values in `data`, also of those that hold others."""
    inner = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    own = [so_far] if so_far else []
    return own + [path for key, value in inner for path in paths(value, (*so_far, key))]


def value_at(data: Any, path: Path) -> Any:
    """Return the value that `path` leads to."""
    for key in path:
        data = data[key]
    return data


def changed(data: dict[str, Any], path: Path, value: Any) -> dict[str, Any]:
    """Return a copy of `data` with another value at `path`, or without it if that is `MISSING`."""
    found = copy.deepcopy(data)
    owner = value_at(found, path[:-1])
    if value is MISSING:
        del owner[path[-1]]
    else:
        owner[path[-1]] = value
    return found


MISSING = object()
