"""The largest density that a scene itself demands: at rest, under its own depth, or behind the shock of its fastest impact.

All formulas are exact for Tait's equation of state with exponent 7 (`physics.equation_of_state`), and all densities are over
the rest density.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.scene import Scene

STRONGEST_JUMP = 16.0  # density over rest up to which a jump is looked for: Mach 5,000


def still_density(potential: float, sound_speed: float) -> float:
    """Density over rest of fluid that a `potential` [m^2/s^2] such as g H or u^2/2 has brought to rest, isentropically.

    Bernoulli: the enthalpy, the integral of dp/rho = c_s^2/6 ((rho/rho_0)^6 - 1), equals the potential.
    """
    return (1.0 + 6.0 * max(potential, 0.0) / sound_speed**2) ** (1.0 / 6.0)


def jump_mach(density: float) -> float:
    """Speed u over c_s of the impact on a wall that leaves `density` over rest: the inverse of `jump_density`."""
    return math.sqrt((density**7 - 1.0) * (density - 1.0) / (7.0 * density))


def jump_density(mach: float) -> float:
    """Density over rest behind the shock that stops fluid of speed u = `mach` c_s.

    Rankine-Hugoniot in the fluid's frame, with the shock's speed U: rho_0 U u = p(rho) and rho_0 U = rho (U - u). So
    rho_0 u^2 = p (1 - rho_0/rho), with p = rho_0 c_s^2/7 ((rho/rho_0)^7 - 1).
    """
    from scipy.optimize import brentq  # not at the top: its import takes longer than NumPy's

    wanted = min(mach, jump_mach(STRONGEST_JUMP))
    return float(brentq(lambda density: jump_mach(density) - wanted, 1.0, STRONGEST_JUMP, xtol=1e-12))


def demanded_density(scene: Scene) -> float:
    """Largest density over rest that `scene` demands by itself: the larger of depth and impact.

    Depth: `still_density` of g H, H being the settled depth or the tallest fluid. Impact: `jump_density` of `impact_speed`.
    Fluid that meets a pool of its own kind is slowed by half only, but the shock's echo from the floor stops the other half.
    """
    depths = [
        np.linalg.norm(g) * max(settled_depth(scene, g), *(_extent(fluid, g) for fluid in scene.fluids))
        for g in gravities(scene)
    ]
    speed = scene.wave_speed
    return max(
        still_density(max(depths) + _body_force_potential(scene), speed), jump_density(impact_speed(scene) / speed)
    )


def impact_speed(scene: Scene) -> float:
    """Largest speed [m/s] at which fluid meets a wall: as it starts, or falling from above the settled depth.

    sqrt(|v|^2 + 2 g h) with h the height of a fluid's top above the depth that all fluid would settle to, so still pools have
    none; after a change of gravity fluid falls from the far side of the domain. The speed of moving walls and of inflow counts.
    """
    falls = [_fall(scene, fluid) + fluid.top_speed**2 for fluid in scene.fluids]
    inflows = [float(np.dot(each.velocity, each.velocity)) for each in scene.inflows]
    return math.sqrt(max(falls + inflows) + 2.0 * _body_force_potential(scene)) + wall_speed(scene)


def wall_speed(scene: Scene) -> float:
    """Largest speed [m/s] of a moving face of the domain."""
    return scene.wall_speed


def gravities(scene: Scene) -> Iterator[tuple[float, ...]]:
    """All values that gravity [m/s^2] takes."""
    yield scene.acceleration
    yield from (change.gravity for change in scene.gravity_changes)


def settled_depth(scene: Scene, gravity: tuple[float, ...]) -> float:
    """Depth [m] of all fluid once it lies flat in the domain, along the axis nearest to `gravity`; 0 without gravity."""
    if not any(gravity):
        return 0.0
    size = list(scene.domain.size)
    across = math.prod(size) / size[int(np.argmax(np.abs(gravity)))]
    return scene.volume / across


def _fall(scene: Scene, fluid: Any) -> float:
    """Largest 2 g h [m^2/s^2] for one fluid."""
    falls = []
    for k, g in enumerate(gravities(scene)):
        uphill = tuple(-a for a in g)
        start = fluid.reach(uphill) if k == 0 else scene.domain.reach(uphill)
        depth = float(np.linalg.norm(g)) * settled_depth(scene, g)
        falls.append(max(start + scene.domain.reach(g) - depth, 0.0))
    slack = 1e-9 * max(falls)
    return 2.0 * max(fall if fall > slack else 0.0 for fall in falls)


def _extent(fluid: Any, gravity: tuple[float, ...]) -> float:
    """Length [m] of a fluid along `gravity`."""
    length = float(np.linalg.norm(gravity))
    uphill = tuple(-a for a in gravity)
    return (fluid.reach(uphill) + fluid.reach(gravity)) / length if length else 0.0


def _body_force_potential(scene: Scene) -> float:
    """Largest difference [m^2/s^2] of the body force's potential between corners of the fluids' common bounding box."""
    if scene.body_force is None:
        return 0.0
    lower = np.min([fluid.lower for fluid in scene.fluids], axis=0)
    upper = np.max([fluid.upper for fluid in scene.fluids], axis=0)
    box = Box(tuple(lower), tuple(upper))
    corners = [*itertools.product(*zip(box.lower, box.upper, strict=True)), tuple(0.5 * (lower + upper))]
    return float(np.ptp(scene.body_force.potential(np.array(corners))))
