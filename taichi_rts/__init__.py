"""Spatially varying time stepping for weakly compressible SPH, on Taichi. Importing starts nothing; call `init`.

`ti` is the Taichi, or the fork of it, that is used: for own kernels.
"""

from taichi_rts.device.backend import init, ti  # first: it keeps Taichi from printing its banner

# isort: split
from taichi_rts import importing  # noqa: F401  first, as Ctrl-C may come while the others are imported
from taichi_rts.errors import (
    BackendError,
    CheckpointError,
    Error,
    OutputError,
    RenderError,
    ResourceError,
    SceneError,
    SimulationDivergedError,
    StepperError,
    TimeError,
)
from taichi_rts.medium.energy import Energy
from taichi_rts.output.change_stepper import change_stepper
from taichi_rts.output.checkpoint import load_checkpoint, save_checkpoint
from taichi_rts.output.export import Exporter, write_particles
from taichi_rts.output.series import Series
from taichi_rts.particle_files.formats import read_particles
from taichi_rts.particle_files.frame import ParticleFrame
from taichi_rts.scene.fluids.block import Block
from taichi_rts.scene.fluids.particles import Particles
from taichi_rts.scene.fluids.sphere import Sphere
from taichi_rts.scene.loading import load_scene, scene_names, scene_schema
from taichi_rts.scene.obstacles.box import BoxObstacle
from taichi_rts.scene.obstacles.cylinder import CylinderObstacle
from taichi_rts.scene.obstacles.mesh import MeshObstacle
from taichi_rts.scene.obstacles.motion import ConstantMotion, Keyframes
from taichi_rts.scene.obstacles.polygon import PolygonObstacle
from taichi_rts.scene.obstacles.sphere import SphereObstacle
from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.parts.conditions import GravityChange, Inflow, MovingWall, Outlet
from taichi_rts.scene.parts.probes import Gauge, Probe
from taichi_rts.scene.parts.sound import RegionalSound
from taichi_rts.scene.parts.velocities import LinearField, StandingWave, TaylorGreen
from taichi_rts.scene.parts.view import View
from taichi_rts.scene.scene import Scene
from taichi_rts.simulation import Simulation
from taichi_rts.solver.stepping.asynchronous import Asynchronous
from taichi_rts.solver.stepping.base import Stepper
from taichi_rts.solver.stepping.regional import Regional
from taichi_rts.solver.stepping.steppers import register_stepper
from taichi_rts.solver.stepping.uniform import Uniform

__version__ = "0.1.0"


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])


__all__ = [
    "Asynchronous",
    "BackendError",
    "Block",
    "Box",
    "BoxObstacle",
    "CheckpointError",
    "ConstantMotion",
    "CylinderObstacle",
    "Energy",
    "Error",
    "Exporter",
    "Gauge",
    "GravityChange",
    "Inflow",
    "Keyframes",
    "LinearField",
    "MeshObstacle",
    "MovingWall",
    "Outlet",
    "OutputError",
    "ParticleFrame",
    "Particles",
    "PolygonObstacle",
    "Probe",
    "Regional",
    "RegionalSound",
    "RenderError",
    "ResourceError",
    "Scene",
    "SceneError",
    "Series",
    "Simulation",
    "SimulationDivergedError",
    "Sphere",
    "SphereObstacle",
    "StandingWave",
    "Stepper",
    "StepperError",
    "TaylorGreen",
    "TimeError",
    "Uniform",
    "View",
    "change_stepper",
    "init",
    "load_checkpoint",
    "load_scene",
    "read_particles",
    "register_stepper",
    "save_checkpoint",
    "scene_names",
    "scene_schema",
    "ti",
    "write_particles",
]
