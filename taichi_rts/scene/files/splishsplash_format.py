"""What a SPlisHSPlasH scene file may hold, as far as it is read here: names, types and limits of its JSON.

The names are the file's, in snake case here. Keys that are not listed stay in `model_extra`: the format has many that only its
own solvers or windows use.
"""

from __future__ import annotations

from typing import Annotated, Any

from annotated_types import Len
from pydantic import AliasChoices, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic.alias_generators import to_camel, to_pascal

from taichi_rts.scene.parts.rotations import Turn
from taichi_rts.scene.validation import NotNegative, Positive

Vector3 = Annotated[tuple[float, ...], Len(3, 3)]
Size3 = Annotated[tuple[Positive, ...], Len(3, 3)]
Name = Annotated[str, BeforeValidator(lambda value: str(value) if isinstance(value, int) else value)]
ZERO = (0.0, 0.0, 0.0)
ONE = (1.0, 1.0, 1.0)
FLUID = "Fluid"  # the name of a fluid that has none


class Part(BaseModel):
    """One JSON object of the file."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, frozen=True, alias_generator=to_camel)


class Configuration(Part):
    """Lengths [m], times [s], acceleration [m/s^2]; the rest are numbers of methods."""

    particle_radius: Positive = 0.025
    gravitation: Vector3 = (0.0, -9.81, 0.0)
    sim_2d: bool = Field(False, alias="sim2D")
    stop_at: float = -1.0
    pause_at: float = -1.0
    time_step_size: Positive = 0.001
    cfl_method: int = 1
    cfl_factor: Positive = 0.5
    cfl_max_time_step_size: Positive = 0.005
    simulation_method: int = 4
    kernel: int = 4
    viscosity: NotNegative | None = None
    script_file: str | None = None
    camera_position: Vector3 | None = None
    camera_lookat: Vector3 | None = None


class Material(Part):
    """A fluid's constants: rest density [kg/m^3], and the numbers of its methods with, beside them, their parameters."""

    id: Name = FLUID
    density0: Positive = 1000.0
    viscosity: NotNegative | None = None
    viscosity_method: int = 1
    surface_tension_method: int = 0
    elasticity_method: int = 0
    vorticity_method: int = 0
    drag_method: int = 0


class Placed(Part):
    """Something that is scaled, turned by `rotation_angle` [rad] about `rotation_axis`, and then moved [m]."""

    translation: Vector3 = ZERO
    rotation_axis: Vector3 = (1.0, 0.0, 0.0)
    rotation_angle: float = 0.0
    scale: Size3 = ONE


class RigidBody(Placed):
    """A mesh; an inverted one is a container."""

    id: Name | None = None
    geometry_file: str
    is_dynamic: bool = False
    is_animated: bool = False
    is_wall: bool = False
    map_invert: bool = Field(False, validation_alias=AliasChoices("mapInvert", "invertSDF"))


class FluidBlock(Part):
    """A box of fluid between `start` and `end`, which are scaled and then moved."""

    id: Name = FLUID
    start: Vector3
    end: Vector3
    translation: Vector3 = ZERO
    scale: Size3 = ONE
    dense_mode: int = 0
    initial_velocity: Vector3 = ZERO
    initial_angular_velocity: Vector3 = ZERO


class FluidModel(Placed):
    """Particles of a file, or those that fill its mesh."""

    id: Name = FLUID
    particle_file: str
    initial_velocity: Vector3 = ZERO
    initial_angular_velocity: Vector3 = ZERO


class Emitter(Part):
    """A nozzle, `width` by `height` particles large or (type 1) round, that looks along its turned x axis at `velocity` [m/s]."""

    id: Name = FLUID
    width: Positive = 5
    height: Positive = 5
    translation: Vector3 = ZERO
    rotation_axis: Vector3 = (1.0, 0.0, 0.0)
    rotation_angle: float = 0.0
    velocity: Positive = 1.0
    type: int = 0
    emit_start_time: NotNegative = 0.0
    emit_end_time: Positive | None = None


class SplishsplashFile(Part):
    """The whole file."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, frozen=True, alias_generator=to_pascal)

    configuration: Configuration = Configuration.model_validate({})
    materials: tuple[Material, ...] = ()
    rigid_bodies: tuple[RigidBody, ...] = ()
    fluid_blocks: tuple[FluidBlock, ...] = ()
    fluid_models: tuple[FluidModel, ...] = ()
    emitters: tuple[Emitter, ...] = ()


def turn_of(part: Any, dim: int = 3) -> Turn | None:
    """Rotation [degrees] of a part, as scenes give it; None where it does not turn. In two dimensions about z."""
    length = sum(x * x for x in part.rotation_axis) ** 0.5
    degrees = part.rotation_angle * 57.29577951308232
    if degrees == 0.0 or (dim == 3 and length == 0.0):
        return None
    if dim == 2:
        return (degrees if part.rotation_axis[2] >= 0.0 else -degrees,)
    return tuple(degrees * x / length for x in part.rotation_axis)
