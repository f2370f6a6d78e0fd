"""Scenes of SPlisHSPlasH (https://github.com/InteractiveComputerGraphics/SPlisHSPlasH), JSON files of its versions 2.x.

What is read becomes plain data like a TOML file's, so that the scene has the same checks. What cannot be honoured is listed in
one warning: docs/scene_files.md.
"""

from __future__ import annotations

import difflib
import itertools
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pydantic

from taichi_rts.errors import SceneError
from taichi_rts.particle_files.formats import READ
from taichi_rts.scene.files import splishsplash_fluids as fluids
from taichi_rts.scene.files.splishsplash_bodies import Body, motor, obstacle, read_body
from taichi_rts.scene.files.splishsplash_format import Configuration, FluidModel, Material, SplishsplashFile, turn_of
from taichi_rts.scene.fluids.block import Block
from taichi_rts.scene.fluids.particles import Particles
from taichi_rts.scene.geometry.drowned import is_drowned
from taichi_rts.scene.obstacles.making import make_solid
from taichi_rts.scene.obstacles.shapes import Obstacle
from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.validation import describe

SOLVERS = ("WCSPH", "PCISPH", "PBF", "IISPH", "DFSPH", "PF", "ICSPH")
KERNELS = {0: "cubic_spline", 1: "wendland_c2", 4: "cubic_spline"}
END_TIME = 2.0
"""Physical time [s] of a scene that sets neither stopAt nor pauseAt, and so runs until its window is closed."""
ROOM = 0.25
"""Room around a scene without container, as a share of its largest extent."""
DEFAULT = Material.model_validate({})
COLOURS = ("#0072B2", "#D55E00", "#7FD8B8", "#F0C929", "#7B2D8B")
OBSTACLE: Any = pydantic.TypeAdapter(Obstacle)
LISTED = {  # sections that nothing here reads
    "AnimationFields": "animation fields",
    "TetModels": "deformable bodies",
    "TriangleModels": "cloth",
}
Named = tuple[str, dict[str, Any]]
"""Plain data of a fluid, and the name of its material."""


def from_splishsplash(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return plain data of a scene, from the data of the SPlisHSPlasH file `path`; warns once of what is not honoured.

    Raises `SceneError` that lists every fault of the file with its path in it.
    """
    try:
        file = SplishsplashFile.model_validate(data)
    except pydantic.ValidationError as error:
        raise SceneError(describe(error, str(path))) from None
    reader = Reader(file, path)
    scene = reader.read()
    if reader.notes:
        warnings.warn(f"{path}: not honoured: {'; '.join(dict.fromkeys(reader.notes))}", stacklevel=3)
    return scene


class Reader:
    """Turns one file into plain data; `notes` lists what it could not honour."""

    def __init__(self, file: SplishsplashFile, path: Path) -> None:
        self.file = file
        self.path = path
        self.configuration: Configuration = file.configuration
        self.dim = 2 if self.configuration.sim_2d else 3
        self.spacing = 2.0 * self.configuration.particle_radius
        self.notes: list[str] = []
        self.faults: list[str] = []

    def read(self) -> dict[str, Any]:
        """Return the scene's data; raises `SceneError`."""
        configuration = self.configuration
        bodies = self._bodies()
        fluid = self._fluids()
        self._fail()
        if not fluid and not self.file.emitters:
            raise SceneError(f"{self.path}: holds no fluid; give it FluidBlocks or FluidModels")
        lower, upper, container = self._domain(bodies, fluid)
        obstacles = self._obstacles([body for body in bodies if body is not container])
        fluid = self._outside(self._inside(fluid, lower, upper), obstacles, Box(tuple(lower), tuple(upper)))
        end = next((t for t in (configuration.stop_at, configuration.pause_at) if t > 0.0), END_TIME)
        inflows = self._inflows(lower, upper, end)
        if not fluid:
            raise SceneError(
                f"{self.path}: holds no fluid at the start, only emitters; give it FluidBlocks or FluidModels"
            )
        materials = self._materials(fluid)
        self._list_methods()
        gravity = list(configuration.gravitation[: self.dim])
        moves = any(gravity) or any("velocity" in part for _, part in fluid) or bool(inflows)
        scene = {
            "description": f"{self.path.name}, a SPlisHSPlasH scene",
            "spacing": self.spacing,
            "end_time": end,
            "domain": {"lower": lower.tolist(), "upper": upper.tolist()},
            "gravity": gravity,
            "fluids": [part for _, part in fluid],
            "obstacles": obstacles,
            "inflows": inflows,
            "kernel": KERNELS.get(configuration.kernel, "cubic_spline"),
            **materials,
        }
        if not moves:
            scene["sound_speed"] = 10.0 * self._largest_speed()
        if self.dim == 3 and configuration.camera_position and configuration.camera_lookat:
            scene["view"] = {"eye": list(configuration.camera_position), "target": list(configuration.camera_lookat)}
        return scene

    def _fail(self) -> None:
        if self.faults:
            raise SceneError(f"{self.path}: " + "\n  ".join(self.faults))

    def _file(self, name: str, given: str) -> Path:
        """Find a file that the scene names: beside its folder, as SPlisHSPlasH's models are, but not further away."""
        root = self.path.resolve().parent.parent
        found = (self.path.resolve().parent / given).resolve()
        if not found.is_relative_to(root):
            self.faults.append(f"{name}: {given!r} leaves {str(root)!r}, the folder above the scene's; put it there")
        return found

    def _bodies(self) -> list[Body]:
        found = []
        for k, part in enumerate(self.file.rigid_bodies):
            name = f"RigidBodies.{k}"
            file = self._file(f"{name}.geometryFile", part.geometry_file)
            self._fail()
            try:
                found.append(read_body(name, part, file))
            except SceneError as error:
                self.faults.append(str(error))
        return found

    def _fluids(self) -> list[Named]:
        """Fluids at the start."""
        found = []
        for k, part in enumerate(self.file.fluid_blocks):
            data = fluids.block(part, self.spacing, self.dim)
            if data is None:
                self.notes.append(f"FluidBlocks.{k} (at most one particle thick, so SPlisHSPlasH leaves it empty too)")
                continue
            if part.dense_mode:
                self.notes.append(f"FluidBlocks.{k}.denseMode {part.dense_mode} (filled with a cubic lattice)")
            found.append((part.id, data))
        for k, model in enumerate(self.file.fluid_models):
            data = self._model(f"FluidModels.{k}", model)
            if data is not None:
                found.append((model.id, data))
        return found

    def _model(self, name: str, part: FluidModel) -> dict[str, Any] | None:
        """Data of a fluid given by a particle file."""
        file = self._file(f"{name}.particleFile", part.particle_file)
        if file.suffix.lower() not in READ:
            self.notes.append(f"{name}.particleFile {part.particle_file!r} (only {', '.join(READ)} are read; left out)")
            return None
        if not fluids.at_rest(part):
            self.notes.append(f"{name}.initialVelocity (a file's particles have its own)")
        turn = turn_of(part, self.dim)
        data: dict[str, Any] = {
            "file": str(file),
            "scale": part.scale[0],
            "translation": list(part.translation[: self.dim]),
        }
        data |= {"rotation": list(turn)} if turn else {}
        try:
            Particles(**data)
        except SceneError as error:
            self.faults.append(f"{name}: {error}")
            return None
        return data

    def _domain(self, bodies: list[Body], fluid: list[Named]) -> tuple[np.ndarray, np.ndarray, Body | None]:
        """Lower and upper corner [m], (dim,), of the domain, and the body that it is."""
        dim = self.dim
        containers = [body for body in bodies if body.is_container]
        if containers:
            body = max(containers, key=lambda each: float(np.ptp(each.vertices, axis=0).prod()))
            lower, upper = body.vertices.min(axis=0)[:dim], body.vertices.max(axis=0)[:dim]
            if not body.upright:
                self.notes.append(f"{body.name} (the domain is the box around it, {_box(lower, upper)})")
            return lower, upper, body
        corners = [body.vertices[:, :dim] for body in bodies]
        for _, part in fluid:
            data = Particles(**part) if "file" in part else None
            corners.append(np.array([data.lower, data.upper] if data else [part["lower"], part["upper"]]))
        corners += [np.array([each.translation[:dim]]) for each in self.file.emitters]
        points = np.concatenate(corners)
        lower, upper = points.min(axis=0), points.max(axis=0)
        room = self.spacing * np.ceil(ROOM * float((upper - lower).max()) / self.spacing + 2.0)
        ground = min((float(body.vertices[:, 1].min()) for body in bodies), default=np.inf)
        below = np.where((np.arange(dim) == 1) & (ground <= lower[1]), 0.0, room)  # nothing falls through a ground
        lower, upper = lower - below, upper + room
        self.notes.append(f"no container (walls around everything and some room: {_box(lower, upper)})")
        return lower, upper, None

    def _obstacles(self, bodies: list[Body]) -> list[dict[str, Any]]:
        motors = self._motors()
        found = []
        for body in bodies:
            part = body.part
            try:
                data = obstacle(body, self.dim)
            except SceneError as error:
                if "install it" in str(error):
                    raise
                self.notes.append(f"{body.name} (left out: {error})")
                continue
            moves = motors.get(part.id or "", None)
            if moves and self.dim == 3:
                data["motion"] = moves
            elif part.is_dynamic or part.is_animated:
                self.notes.append(
                    f"{body.name}.{'isDynamic' if part.is_dynamic else 'isAnimated'} (it stays where it is)"
                )
            if body.is_container:
                self.notes.append(f"{body.name}.isWall (one container only; this one is an obstacle)")
            found.append(data)
        return found

    def _motors(self) -> dict[str, dict[str, Any]]:
        """Motion of bodies that a hinge turns at a constant speed, by their id."""
        extra = self.file.model_extra or {}
        found: dict[str, dict[str, Any]] = {}
        for key in sorted(key for key in extra if key.endswith(("Joints", "Springs"))):
            for k, joint in enumerate(extra[key] if isinstance(extra[key], list) else []):
                moves = motor(joint) if key == "TargetVelocityMotorHingeJoints" and isinstance(joint, dict) else None
                if moves:
                    found[str(joint.get("bodyID1"))] = moves
                else:
                    self.notes.append(f"{key}.{k}")
        return found

    def _inside(self, fluid: list[Named], lower: np.ndarray, upper: np.ndarray) -> list[Named]:
        """Leave out what lies outside the domain."""
        kept = []
        for name, part in fluid:
            inside, less = (part, False) if "file" in part else fluids.clip(part, lower, upper, self.spacing)
            if less:
                self.notes.append(f"fluid outside the walls (left out of {_box(part['lower'], part['upper'])})")
            if inside is not None:
                kept.append((name, inside))
        return kept

    def _outside(self, fluid: list[Named], obstacles: list[dict[str, Any]], domain: Box) -> list[Named]:
        """Leave out blocks in obstacles: SPlisHSPlasH's are shells, which may be filled, ours are solid."""
        solids = [make_solid(OBSTACLE.validate_python(each), self.spacing, domain) for each in obstacles]
        kept = [
            (name, part)
            for name, part in fluid
            if "file" in part
            or not any(is_drowned(Block(part["lower"], part["upper"]), solid, self.spacing) for solid in solids)
        ]
        if left := len(fluid) - len(kept):
            self.notes.append(f"fluid inside a rigid body ({left} blocks left out: bodies are solid)")
        return kept

    def _inflows(self, lower: np.ndarray, upper: np.ndarray, end: float) -> list[dict[str, Any]]:
        found = []
        for k, part in enumerate(self.file.emitters):
            data, remark = fluids.inflow(part, lower, upper, self.spacing, end)
            if data is not None:
                found.append(data)
            if data is None or remark:
                self.notes.append(f"Emitters.{k} ({remark if data is not None else f'left out: it {remark}'})")
        return found

    def _materials(self, fluid: list[Named]) -> dict[str, Any]:
        """Give the fluids their viscosity and colour; return what the scene has of their materials."""
        known = {material.id: material for material in self.file.materials}
        used = list(dict.fromkeys(name for name, _ in fluid))
        densities = [known.get(name, DEFAULT).density0 for name in used]
        if len(set(densities)) > 1:
            self.notes.append(
                f"density0 of {', '.join(used[1:])} (a scene has one rest density: {densities[0]:g} kg/m^3)"
            )
        for name, colour in zip(used, itertools.cycle(COLOURS), strict=False):
            nu, other = fluids.viscosity(known.get(name, DEFAULT), self.configuration)
            if other:
                self.notes.append(f"{other} of {name} (its coefficient is no kinematic viscosity)")
            for _, part in (each for each in fluid if each[0] == name):
                part |= {"kinematic_viscosity": nu} if nu else {}
                part |= {"colour": colour} if len(used) > 1 else {}
        return {"rest_density": densities[0]}

    def _list_methods(self) -> None:
        """List solvers and forces that there are not here."""
        configuration = self.configuration
        number = configuration.simulation_method
        solver = SOLVERS[number] if 0 <= number < len(SOLVERS) else f"simulationMethod {number}"
        if solver != "WCSPH":
            self.notes.append(f"{solver} (weakly compressible SPH instead)")
        if configuration.kernel not in KERNELS:
            self.notes.append(f"kernel {configuration.kernel} (the cubic spline instead)")
        if configuration.script_file:
            self.notes.append(f"scriptFile {configuration.script_file!r} (no code of scenes is run)")
        for material in self.file.materials:
            for name in ("surface_tension", "elasticity", "vorticity", "drag"):
                if method := getattr(material, f"{name}_method"):
                    self.notes.append(f"{name.replace('_', ' ')} of {material.id} (method {method})")
        extra = self.file.model_extra or {}
        self.notes += [text for key, text in LISTED.items() if extra.get(key)]
        fields = [field.alias or name for name, field in Configuration.model_fields.items()]
        for key in configuration.model_extra or {}:
            near = difflib.get_close_matches(key, fields, n=1, cutoff=0.85)
            if near and near[0] != key:
                self.notes.append(f"Configuration.{key} (did you mean {near[0]!r}?)")

    def _largest_speed(self) -> float:
        """Speed [m/s] at which the file's largest step still meets its CFL condition dt = 0.4 f d / |v|.

        The best there is to size the sound speed by where nothing falls or moves at the start.
        """
        each = self.configuration
        step = each.time_step_size if each.cfl_method == 0 else each.cfl_max_time_step_size
        return 0.4 * each.cfl_factor * self.spacing / step


def _box(lower: Any, upper: Any) -> str:
    return " to ".join("(" + ", ".join(f"{x:.4g}" for x in corner) + ")" for corner in (lower, upper))
