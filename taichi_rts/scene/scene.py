"""What is simulated: a frozen, validated description, as plain as the TOML file that may hold it.

SI units throughout: m, s, kg. A vector with two components makes a two-dimensional scene.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

import pydantic
from annotated_types import Len
from pydantic import Field, StringConstraints, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.checks.contradictions import contradictions
from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.scene.parts.conditions import AXES, Axis, GravityChange, Inflow, MovingWall, Outlet
from taichi_rts.scene.parts.obstacles import Obstacle
from taichi_rts.scene.parts.particles import Particles
from taichi_rts.scene.parts.probes import Gauge, Probe
from taichi_rts.scene.parts.shapes import Box, Fluid, top_speed
from taichi_rts.scene.parts.sound import FLOOR, RegionalSound, SoundSpeed
from taichi_rts.scene.parts.velocities import LinearField
from taichi_rts.scene.parts.view import View
from taichi_rts.scene.validation import FROZEN, NAME, NotNegative, Number, Positive, Vector, validated

LARGEST_RATIO = 32.0  # of sound speeds in one scene
MOST_PARTS = 1000  # fluids or obstacles of a scene: each is compared with each
WORTHWHILE = 2.0
"""Ratio of the one sound speed to the smallest regional one from which on regional ones pay (docs/regional_sound_speed.md)."""


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Scene:
    """A closed box of walls, the blocks and spheres of fluid in it, what drives them, and the constants of the fluid.

    Attributes:
        domain: the box that no particle's centre leaves.
        fluids: blocks and spheres of fluid, and `Particles` given one by one; they may touch but not overlap, two spheres stay
            half a spacing apart.
        spacing: initial particle spacing s [m].
        gravity: acceleration [m/s^2], (dim,); None: 9.81 m/s^2 along -y.
        gravity_changes: from each one's time on gravity is another.
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
    gravity_changes: tuple[GravityChange, ...] = ()
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

    @model_validator(mode="after")
    def _check(self) -> Scene:
        faults = contradictions(self)
        if faults:
            raise ValueError("\n  ".join(faults))
        return self

    @property
    def dim(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return len(self.domain.lower)

    @property
    def support(self) -> float:
        """Support radius r [m], also the side of a block."""
        return self.support_ratio * self.spacing

    @property
    def wall_planes(self) -> int:
        """How many planes of wall particles lie behind a face: as many as the lattice has there in reach of a resting layer.

        The lattice's planes lie s, 2s, ... from the layer that rests half a spacing from the face, and those nearer than r count:
        one up to r = 2s, two up to 3s, three up to 4s. One plane that has their density and slope in a lattice at rest will
        not do: a still pool at r = 3s falls through it (docs/validation.md).
        """
        return math.ceil(self.support_ratio - 1e-9) - 1

    @property
    def acceleration(self) -> tuple[float, ...]:
        """Gravity [m/s^2], (dim,), at the start, with the default filled in."""
        return self.gravity if self.gravity is not None else (0.0, -9.81, 0.0)[: self.dim]

    def acceleration_at(self, time: float) -> tuple[float, ...]:
        """Gravity [m/s^2], (dim,), at `time` [s]."""
        return next((c.gravity for c in reversed(self.gravity_changes) if c.time <= time), self.acceleration)

    @property
    def is_periodic(self) -> tuple[bool, ...]:
        """For each axis whether the domain repeats itself along it, (dim,)."""
        return tuple(axis in self.periodic for axis in AXES[: self.dim])

    @property
    def viscosities(self) -> tuple[float, ...]:
        """Kinematic viscosity [m^2/s] of each fluid, (len(fluids),), and of what flows in, if anything does."""
        own = (fluid.kinematic_viscosity for fluid in self.fluids)
        inflow = (self.kinematic_viscosity,) * bool(self.inflows)
        return (*(self.kinematic_viscosity if nu is None else nu for nu in own), *inflow)

    @property
    def fluid_names(self) -> tuple[str, ...]:
        """What legends call each fluid, (len(fluids),), and what flows in, if anything does."""
        return (*(f"fluid {k}" for k in range(1, len(self.fluids) + 1)), *("inflow",) * bool(self.inflows))

    @property
    def fluid_colours(self) -> tuple[str | None, ...]:
        """Colour of each of `fluid_names`, None for the palette's."""
        return (*(fluid.colour for fluid in self.fluids), *(None,) * bool(self.inflows))

    @property
    def regional_sound(self) -> RegionalSound | None:
        """What governs the regional sound speed, if there is one."""
        if self.sound_speed == "regional":
            return RegionalSound()
        return self.sound_speed if isinstance(self.sound_speed, RegionalSound) else None

    @property
    def wave_speed(self) -> float:
        """Sound speed c_s [m/s]: as given, or ten times `estimate_max_speed` (Becker & Teschner 2007, for 1 % compression).

        The largest, where it is regional: it sets the base step.
        """
        regional = self.regional_sound
        if regional is not None:
            return regional.cap if regional.cap is not None else 2.0 / regional.mach * self.estimate_max_speed()
        given = self.sound_speed
        return float(given) if isinstance(given, (int, float)) else 10.0 * self.estimate_max_speed()

    def with_sound_for(self, stepper: Any) -> Scene:
        """Return the scene with "auto" decided for `stepper`, an object of `taichi_rts.solver.stepping.steppers`.

        Regional for steppers that can use it (`follows_sound`), where density is summed, without background pressure, and
        where sound speeds may differ by `WORTHWHILE`; else one sound speed.
        """
        if self.sound_speed != "auto":
            return self
        regional = self.replace(sound_speed="regional") if self.bears_regional_sound else self
        pays = stepper.follows_sound and self.wave_speed >= WORTHWHILE * regional.least_wave_speed
        return regional if pays and self.bears_regional_sound else self.replace(sound_speed=None)

    @property
    def bears_regional_sound(self) -> bool:
        """Whether the sound speed may be regional: it needs summed densities and no background pressure."""
        return self.density == "summation" and self.background_pressure == 0.0

    @property
    def viscous_wave_speed(self) -> float:
        """Sound speed [m/s] in the artificial viscosity alpha h c: that of the scene with one sound speed.

        It must not follow the region, or calm water would get less viscosity and the flow would be another.
        """
        return self.wave_speed if self.regional_sound is None else 10.0 * self.estimate_max_speed()

    @property
    def least_wave_speed(self) -> float:
        """Smallest sound speed [m/s] that any region may have; `wave_speed` where it is the same everywhere."""
        regional = self.regional_sound
        if regional is None:
            return self.wave_speed
        floor = regional.floor if regional.floor is not None else FLOOR * math.sqrt(self.depth_potential)
        return min(max(floor, self.wave_speed / LARGEST_RATIO), self.wave_speed)

    @property
    def depth_potential(self) -> float:
        """Product g H [m^2/s^2], H being the largest depth of the fluids, one on top of the other, under any gravity."""
        return max(self._stack(gravity) for gravity in (self.acceleration, *(c.gravity for c in self.gravity_changes)))

    def _stack(self, gravity: tuple[float, ...]) -> float:
        """Product g H [m^2/s^2] under `gravity` [m/s^2], (dim,): fluids that overlap across its main axis stand on each other."""
        main = max(range(self.dim), key=lambda d: abs(gravity[d]))
        across = [d for d in range(self.dim) if d != main]
        thickness = [
            sum(abs(g) * (b - a) for g, a, b in zip(gravity, fluid.lower, fluid.upper, strict=True))
            for fluid in self.fluids
        ]
        return max(
            sum(
                thickness[k]
                for k, other in enumerate(self.fluids)
                if all(other.lower[d] < fluid.upper[d] and fluid.lower[d] < other.upper[d] for d in across)
            )
            for fluid in self.fluids
        )

    @property
    def wall_speed(self) -> float:
        """Largest speed [m/s] of a moving wall or of a point of a moving obstacle."""
        return max([0.0, *(wall.top_speed for wall in self.moving_walls), *(body.top_speed for body in bodies(self))])

    def estimate_max_speed(self) -> float:
        """Largest speed [m/s] any fluid can reach by falling from where it is: max of sqrt(|v|^2 + 2 g H).

        H [m] is the height of a fluid's top above the lowest corner of the domain, along gravity, |v| the largest speed in
        its bounding box, or of an inflow, a moving wall or an obstacle. After a change of gravity fluid may fall through all
        of the domain; along a periodic axis it falls once around. A body force is left out.
        """
        uphill = tuple(-a for a in self.acceleration)
        starts = [(top_speed(fluid), fluid.reach(uphill)) for fluid in self.fluids]
        starts += [(math.hypot(*inflow.velocity), inflow.reach(uphill)) for inflow in self.inflows]
        falls = [(speed, max(height - self.floor_potential, 0.0)) for speed, height in starts]
        top = max(speed for speed, _ in falls)
        for change in self.gravity_changes:
            falls.append(
                (top, sum(abs(g) * length for g, length in zip(change.gravity, self.domain.size, strict=False)))
            )
        return max(self.wall_speed, *(math.sqrt(speed**2 + 2.0 * fall) for speed, fall in falls))

    @property
    def floor_potential(self) -> float:
        """Smallest value of -g.x over the domain [m^2/s^2], with the gravity of the start: there the potential energy is 0."""
        return -self.domain.reach(self.acceleration)

    def replace(self, **changes: Any) -> Scene:
        """Return a copy with some fields changed; raises `SceneError` as the constructor does."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}  # type: ignore[arg-type]
        return Scene(**(fields | changes))

    def __rich_repr__(self) -> Iterator[Any]:
        yield self.name
        yield "domain", self.domain
        yield "fluids", len(self.fluids)
        yield "particles", round(self.volume / self.spacing**self.dim)
        yield "spacing", self.spacing
        yield "end_time", self.end_time

    @property
    def volume(self) -> float:
        """Volume [m^3] (area [m^2] in two dimensions) of all fluid at the start."""
        return sum(
            fluid.count * self.spacing**self.dim if isinstance(fluid, Particles) else fluid.volume
            for fluid in self.fluids
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain data that JSON and TOML can hold."""
        return pydantic.TypeAdapter(Scene).dump_python(self, mode="json", exclude_none=True)
