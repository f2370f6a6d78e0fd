"""What is simulated: a frozen, validated description, as plain as the TOML file that may hold it.

SI units throughout: m, s, kg. A vector with two components makes a two-dimensional scene.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import pydantic
from annotated_types import Len
from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.shapes import Block, Box, Fluid, LinearField, Sphere, separation, top_speed
from taichi_rts.validation import FROZEN, NotNegative, Positive, Vector, describe, validated

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

BUILT_IN = Path(__file__).parent / "scenes"


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class View:
    """Where pictures are taken from: `azimuth` and `elevation` [degrees] around the domain, or `eye` and `target` [m]."""

    azimuth: float = -35.0
    elevation: Annotated[float, Field(ge=-90, le=90)] = 20.0
    eye: Vector | None = None
    target: Vector | None = None
    zoom: Positive = 1.0


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Scene:
    """A closed box of walls, the blocks and spheres of fluid in it, and the constants of the fluid.

    Attributes:
        domain: the box that no particle's centre leaves.
        fluids: blocks and spheres of fluid; they may touch but not overlap, two spheres stay half a spacing apart.
        spacing: initial particle spacing s [m].
        gravity: acceleration [m/s^2], (dim,); None: 9.81 m/s^2 along -y.
        body_force: acceleration [m/s^2] added to gravity, linear in space; its gradient must be symmetric.
        sound_speed: c_s [m/s]; None: ten times an estimate of the largest speed (see `estimate_max_speed`).
        density: how density is computed; "summation" is the only formulation.
        kernel: "cubic_spline" or "wendland_c2".
        support_ratio: support radius r over spacing s.
        rest_density: rho_0 [kg/m^3] (per metre of depth in two dimensions).
        artificial_viscosity: alpha of Monaghan's artificial viscosity; 0 compiles it out.
        kinematic_viscosity: nu [m^2/s] of the laminar viscosity; 0 compiles it out.
        walls: whether the domain's faces carry wall particles; without, they only stop centres.
        end_time: how long the scene is worth watching [s].
        view: where pictures are taken from.

    Raises `SceneError` that lists every fault at once.
    """

    domain: Box
    fluids: Annotated[tuple[Fluid, ...], Len(1)]
    spacing: Positive
    gravity: Vector | None = None
    body_force: LinearField | None = None
    sound_speed: Positive | None = None
    density: Literal["summation"] = "summation"
    kernel: Literal["cubic_spline", "wendland_c2"] = "cubic_spline"
    support_ratio: Annotated[float, Field(ge=1.5, le=4.0)] = 2.0
    rest_density: Positive = 1000.0
    artificial_viscosity: NotNegative = 0.08
    kinematic_viscosity: NotNegative = 0.0
    walls: bool = True
    end_time: Positive = 1.0
    view: View = Field(default_factory=View)
    name: str = "scene"
    description: str = ""

    @model_validator(mode="after")
    def _check(self) -> Scene:
        faults = _contradictions(self)
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
    def acceleration(self) -> tuple[float, ...]:
        """Gravity [m/s^2], (dim,), with the default filled in."""
        return self.gravity if self.gravity is not None else (0.0, -9.81, 0.0)[: self.dim]

    @property
    def wave_speed(self) -> float:
        """Sound speed c_s [m/s]: as given, or ten times `estimate_max_speed` (Becker & Teschner 2007, for 1 % compression)."""
        return self.sound_speed if self.sound_speed is not None else 10.0 * self.estimate_max_speed()

    def estimate_max_speed(self) -> float:
        """Largest speed [m/s] any fluid can reach by falling from where it is: max of sqrt(|v|^2 + 2 g H).

        H [m] is the height of a fluid's top above the lowest corner of the domain, along gravity, |v| the largest speed in
        its bounding box. A body force is left out.
        """
        uphill = tuple(-a for a in self.acceleration)
        falls = (max(fluid.reach(uphill) - self.floor_potential, 0.0) for fluid in self.fluids)
        return max(
            math.sqrt(top_speed(fluid) ** 2 + 2.0 * fall) for fluid, fall in zip(self.fluids, falls, strict=True)
        )

    @property
    def floor_potential(self) -> float:
        """Smallest value of -g.x over the domain [m^2/s^2]: where the potential energy is zero."""
        return -self.domain.reach(self.acceleration)

    def replace(self, **changes: Any) -> Scene:
        """Return a copy with some fields changed; raises `SceneError` as the constructor does."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}  # type: ignore[arg-type]
        return Scene(**(fields | changes))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data that JSON and TOML can hold."""
        return pydantic.TypeAdapter(Scene).dump_python(self, mode="json", exclude_none=True)


_PARTS = (Scene, Box, Block, Sphere, LinearField, View)
_KEYS = [key for cls in _PARTS for key in cls.__dataclass_fields__]  # type: ignore[attr-defined]


def load_scene(name: str | Path, *, particles: float | str | None = None, **changes: Any) -> Scene:
    """Return a built-in scene by name, or the scene in a TOML file.

    `particles` (a number, or text such as "1.5M") sets the spacing so that about as many fluid particles result;
    other keywords replace fields of the scene. Raises `SceneError` for an unknown name, an unreadable file, an
    unknown key or an invalid value.
    """
    path = Path(name)
    if path.suffix != ".toml":
        path = BUILT_IN / f"{name}.toml"
        if not path.is_file():
            known = ", ".join(scene_names())
            raise SceneError(f"scene {str(name)!r} is unknown; choose one of {known}, or name a .toml file")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"scene file {str(path)!r} cannot be read: {error.strerror}; check the path") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SceneError(f"scene file {str(path)!r} is not valid TOML: {error}") from None
    data = {"name": path.stem} | data
    if particles is not None:
        if "spacing" in changes:
            raise SceneError(f"particles {particles!r} and spacing {changes['spacing']!r} are both given; give one")
        data["spacing"] = _spacing_for(scene_from(data, str(path)), parse_count(particles))
    return scene_from(data | changes, str(path))


def scene_from(data: dict[str, Any], source: str = "scene") -> Scene:
    """Build a `Scene` from plain data; raises `SceneError` that lists every fault with its path."""
    try:
        return pydantic.TypeAdapter(Scene).validate_python(data)
    except pydantic.ValidationError as error:
        raise SceneError(describe(error, source, _KEYS)) from None


def scene_names() -> list[str]:
    """List the names of the built-in scenes."""
    return sorted(path.stem for path in BUILT_IN.glob("*.toml"))


def parse_count(value: float | str) -> int:
    """Read a particle count such as 30000, "30k" or "1.5M"; raises `SceneError`."""
    text = str(value).strip()
    factor = {"k": 1e3, "m": 1e6}.get(text[-1:].lower(), 1.0)
    try:
        count = float(text[:-1] if factor > 1.0 else text) * factor
    except ValueError:
        count = math.nan
    if not 1 <= count < 2**31:
        raise SceneError(f"particles {value!r} is not a count from 1 to {2**31 - 1}; write e.g. 30000, 30k or 1.5M")
    return round(count)


def _spacing_for(scene: Scene, count: int) -> float:
    volume = sum(fluid.volume for fluid in scene.fluids)
    return (volume / count) ** (1.0 / scene.dim)


def _contradictions(scene: Scene) -> list[str]:
    """Find what is wrong between fields that are each valid."""
    faults = []
    dim = scene.dim
    if scene.gravity is not None and len(scene.gravity) != dim:
        faults.append(f"gravity {scene.gravity} has {len(scene.gravity)} components; the domain has {dim}")
    faults += _body_force_faults(scene)
    for k, fluid in enumerate(scene.fluids):
        if len(fluid.lower) != dim:
            faults.append(f"fluids.{k}: has {len(fluid.lower)} components; the domain has {dim}")
            continue
        faults += _fluid_faults(scene, k, fluid)
        for other in range(k):
            if len(scene.fluids[other].lower) == dim:
                faults += _pair_faults(scene, k, other)
    if not faults and scene.sound_speed is None and scene.estimate_max_speed() <= 0.0:
        faults.append("sound_speed: nothing falls or moves at the start, so no default follows; give it a value [m/s]")
    return faults


def _body_force_faults(scene: Scene) -> list[str]:
    force = scene.body_force
    if force is None:
        return []
    faults = []
    if force.dim != scene.dim:
        faults.append(f"body_force: has {force.dim} components; the domain has {scene.dim}")
    if not force.is_conservative:
        faults.append(
            f"body_force: gradient {force.gradient} is not symmetric, so it has no potential energy; "
            "make gradient[d][e] equal gradient[e][d]"
        )
    if scene.sound_speed is None:
        faults.append(
            "sound_speed: how fast the body_force makes the fluid is not known, so no default follows; "
            "give ten times the largest speed you expect [m/s]"
        )
    return faults


def _fluid_faults(scene: Scene, k: int, fluid: Block | Sphere) -> list[str]:
    faults = []
    slack = _slack(scene)
    low = all(a >= b - slack for a, b in zip(fluid.lower, scene.domain.lower, strict=True))
    high = all(a <= b + slack for a, b in zip(fluid.upper, scene.domain.upper, strict=True))
    if not (low and high):
        faults.append(
            f"fluids.{k}: {fluid.outline} leaves the domain from "
            f"{scene.domain.lower} to {scene.domain.upper}; move or shrink it, or enlarge the domain"
        )
    if isinstance(fluid, Sphere):
        name, least = "radius", fluid.radius
    else:
        name, least = "shortest edge", min(b - a for a, b in zip(fluid.lower, fluid.upper, strict=True))
    if least < scene.spacing * (1 - 1e-6):
        faults.append(f"spacing: {scene.spacing} exceeds the {name} {least:g} of fluids.{k}; use at most {least:g}")
    return faults


def _pair_faults(scene: Scene, k: int, other: int) -> list[str]:
    one, two = scene.fluids[k], scene.fluids[other]
    gap = separation(one, two)
    slack = _slack(scene)
    if gap < -slack:
        return [f"fluids.{k}: overlaps fluids.{other}; move one of them"]
    # A sphere's particles may lie on its surface, a block's stay half a spacing inside: only two spheres' can coincide.
    both_round = isinstance(one, Sphere) and isinstance(two, Sphere)
    if both_round and gap < 0.5 * scene.spacing - slack:
        return [
            f"fluids.{k}: lies {max(gap, 0.0):g} from fluids.{other}, nearer than half a spacing {0.5 * scene.spacing:g}, "
            "so that particles could coincide; move one of them or use a smaller spacing"
        ]
    return []


def _slack(scene: Scene) -> float:
    return 1e-9 * max(scene.domain.size)  # for lengths [m] that rounding blurs
