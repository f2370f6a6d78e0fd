"""Spatially varying time stepping for weakly compressible SPH, on Taichi. Importing starts nothing; call `init`."""

from taichi_rts.backend import init
from taichi_rts.conditions import GravityChange, Inflow, MovingWall
from taichi_rts.diagnostics import Energy
from taichi_rts.errors import (
    BackendError,
    CheckpointError,
    Error,
    OutputError,
    RenderError,
    SceneError,
    SimulationDivergedError,
    StepperError,
    TimeError,
)
from taichi_rts.fields import LinearField, StandingWave, TaylorGreen
from taichi_rts.output.checkpoint import load_checkpoint, save_checkpoint
from taichi_rts.scene import Scene, View, load_scene, scene_names
from taichi_rts.shapes import Block, Box, Sphere
from taichi_rts.simulation import Simulation
from taichi_rts.sound import RegionalSound
from taichi_rts.stepping.asynchronous import Asynchronous
from taichi_rts.stepping.regional import Regional
from taichi_rts.stepping.uniform import Uniform

__version__ = "0.1.0"
__all__ = [
    "Asynchronous",
    "BackendError",
    "Block",
    "Box",
    "CheckpointError",
    "Energy",
    "Error",
    "GravityChange",
    "Inflow",
    "LinearField",
    "MovingWall",
    "OutputError",
    "Regional",
    "RegionalSound",
    "RenderError",
    "Scene",
    "SceneError",
    "Simulation",
    "SimulationDivergedError",
    "Sphere",
    "StandingWave",
    "StepperError",
    "TaylorGreen",
    "TimeError",
    "Uniform",
    "View",
    "init",
    "load_checkpoint",
    "load_scene",
    "save_checkpoint",
    "scene_names",
]
