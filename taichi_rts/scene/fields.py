"""The fields of a scene: all that a scene file may say, and in which units.

SI units throughout: m, s, kg. A vector with two components makes a two-dimensional scene.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from annotated_types import Len
from pydantic import Field, StringConstraints
from pydantic.dataclasses import dataclass

from taichi_rts.scene.fluids.shapes import Fluid
from taichi_rts.scene.obstacles.shapes import Obstacle
from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.parts.conditions import AXES, Axis, GravityChange, Inflow, MovingWall, Outlet
from taichi_rts.scene.parts.probes import Gauge, Probe
from taichi_rts.scene.parts.sound import SoundSpeed
from taichi_rts.scene.parts.velocities import LinearField
from taichi_rts.scene.parts.view import View
from taichi_rts.scene.validation import FROZEN, NAME, NotNegative, Number, Positive, Vector


def _or_a_file(schema: dict[str, Any]) -> None:
    """Tell a JSON Schema that a scene file may name a table instead (`files.gravity_tables`)."""
    rows = {key: schema.pop(key) for key in ("type", "items") if key in schema}
    file = {"type": "object", "properties": {"file": {"type": "string"}}, "required": ["file"]}
    schema["anyOf"] = [rows, file | {"additionalProperties": False}]


MOST_PARTS = 1000  # fluids or obstacles of a scene: each is compared with each


@dataclass(frozen=True, config=FROZEN)
class SceneFields:
    """A closed box of walls, the blocks and spheres of fluid in it, what drives them, and the constants of the fluid.

    Attributes:
        domain: the box that no particle's centre leaves.
        fluids: blocks and spheres of fluid, and `Particles` given one by one; they may touch but not overlap, two spheres stay
            half a spacing apart.
        spacing: initial particle spacing s [m].
        gravity: acceleration [m/s^2], (dim,); None: 9.81 m/s^2 along -y.
        gravity_changes: from each one's time on gravity is another; a scene file may name a table, `{ file = "g.csv" }`.
        gravity_interpolation: "step": gravity jumps at each change's time; "linear": it goes on at a constant rate from one to
            the next, from `gravity` at time 0 to the first.
        body_force: acceleration [m/s^2] added to gravity, linear in space; its gradient must be symmetric.
        sound_speed: c_s [m/s]; None: ten times an estimate of the largest speed (see `estimate_max_speed`); "regional" or a
            `RegionalSound`: every block's own; "auto": regional where that pays (`with_sound_for`).
        density: "summation" (over the neighbours) or "continuity" (integrated in time, with delta-SPH diffusion).
        background_pressure: [Pa] added to the equation of state; keeps fluid without a free surface from tearing.
        kernel: "cubic_spline" or "wendland_c2".
        support_ratio: support radius r over spacing s.
        rest_density: rho_0 [kg/m^3] (per metre of depth in two dimensions).
        artificial_viscosity: alpha of Monaghan's artificial viscosity; 0 compiles it out.
        kinematic_viscosity: nu [m^2/s] of the laminar viscosity; 0 compiles it out.
        hydrostatic: whether the fluids start compressed by their own weight, instead of falling into it and ringing.
        walls: whether the domain's faces carry wall particles; without, they only stop centres.
        periodic: axes ("x", "y", "z") along which the domain repeats itself; they have no walls.
        moving_walls: faces of the domain that move.
        inflows: patches of the domain's faces through which fluid enters.
        outlets: boxes in which fluid is taken out.
        probes: points where a run's time series has the pressure.
        gauges: lines along gravity on which it has the water's height.
        obstacles: rigid bodies, at rest or moving as prescribed (`obstacles.py`); fluid inside them is left out.
        end_time: how long the scene is worth watching [s].
        view: where pictures are taken from.
        name: what the scene is called, and its folder of results.
        description: one line for lists of scenes.

    Raises `SceneError` that lists every fault at once.
    """

    domain: Box
    fluids: Annotated[tuple[Fluid, ...], Len(1, MOST_PARTS)]
    spacing: Positive
    gravity: Vector | None = None
    gravity_changes: Annotated[tuple[GravityChange, ...], Field(json_schema_extra=_or_a_file)] = ()
    gravity_interpolation: Literal["step", "linear"] = "step"
    body_force: LinearField | None = None
    sound_speed: SoundSpeed | None = None
    density: Literal["summation", "continuity"] = "summation"
    background_pressure: NotNegative = 0.0
    kernel: Literal["cubic_spline", "wendland_c2"] = "cubic_spline"
    support_ratio: Annotated[Number, Field(ge=1.5, le=4.0)] = 2.0
    rest_density: Positive = 1000.0
    artificial_viscosity: NotNegative = 0.08
    kinematic_viscosity: NotNegative = 0.0
    hydrostatic: bool = False
    walls: bool = True
    periodic: tuple[Axis, ...] = ()
    moving_walls: tuple[MovingWall, ...] = ()
    inflows: tuple[Inflow, ...] = ()
    outlets: tuple[Outlet, ...] = ()
    probes: tuple[Probe, ...] = ()
    gauges: tuple[Gauge, ...] = ()
    obstacles: Annotated[tuple[Obstacle, ...], Len(0, MOST_PARTS)] = ()
    end_time: Positive = 1.0
    view: View = Field(default_factory=View)
    name: Annotated[str, StringConstraints(pattern=NAME, max_length=100)] = "scene"
    description: str = ""

    @property
    def dim(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return len(self.domain.lower)

    @property
    def is_periodic(self) -> tuple[bool, ...]:
        """For each axis whether the domain repeats itself along it, (dim,)."""
        return tuple(axis in self.periodic for axis in AXES[: self.dim])
