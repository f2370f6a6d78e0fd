"""The largest density that a scene itself demands: at rest, under its own depth, or behind the shock of its fastest impact.

All formulas are exact for Tait's equation of state with exponent 7 (`physics.equation_of_state`), and all densities are over
the rest density.
"""

from __future__ import annotations

import itertools
import math
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
    gravities = scene.gravity_table.values
    depths = [
        np.linalg.norm(g) * max(settled, *(_extent(fluid, g) for fluid in scene.fluids))
        for g, settled in zip(gravities, settled_depth(scene, gravities), strict=True)
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


def settled_depth(scene: Scene, gravities: np.ndarray) -> np.ndarray:
    """Depths [m], (K,), of all fluid once it lies flat in the domain, along the axis nearest to each of `gravities`, (K, dim).

    0 without gravity.
    """
    size = np.array(scene.domain.size)
    across = size.prod() / size[np.abs(gravities).argmax(axis=1)]
    return np.where(gravities.any(axis=1), scene.volume / across, 0.0)


def _fall(scene: Scene, fluid: Any) -> float:
    """Largest 2 g h [m^2/s^2] for one fluid."""
    gravities = scene.gravity_table.values
    depths = np.linalg.norm(gravities, axis=1) * settled_depth(scene, gravities)
    # From the fluid's own top at the start, from that of the domain after a change; to the bottom of the domain.
    starts = np.abs(gravities) @ np.array(scene.domain.size)
    uphill = tuple((-gravities[0]).tolist())
    starts[0] = fluid.reach(uphill) + scene.domain.reach(scene.acceleration)
    falls = np.maximum(starts - depths, 0.0)
    return 2.0 * float(falls[falls > 1e-9 * falls.max()].max(initial=0.0))


def _extent(fluid: Any, gravity: np.ndarray) -> float:
    """Length [m] of a fluid along `gravity`."""
    length = float(np.linalg.norm(gravity))
    down = tuple(gravity.tolist())
    return (fluid.reach(tuple(-a for a in down)) + fluid.reach(down)) / length if length else 0.0


def _body_force_potential(scene: Scene) -> float:
    """Largest difference [m^2/s^2] of the body force's potential between corners of the fluids' common bounding box."""
    if scene.body_force is None:
        return 0.0
    lower = np.min([fluid.lower for fluid in scene.fluids], axis=0)
    upper = np.max([fluid.upper for fluid in scene.fluids], axis=0)
    box = Box(tuple(lower), tuple(upper))
    corners = [*itertools.product(*zip(box.lower, box.upper, strict=True)), tuple(0.5 * (lower + upper))]
    return float(np.ptp(scene.body_force.potential(np.array(corners))))
