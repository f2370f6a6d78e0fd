"""Which constants of a scene do not go together: flow that no weakly compressible fluid can follow, numbers that overflow."""

from __future__ import annotations

import math

import numpy as np

from taichi_rts.scene.parts.box import corners
from taichi_rts.scene.scales import SceneScales

MOST_MACH = 2.0
"""Largest Mach number at which a scene may be set up: that of the speed at which a run counts as blown up."""
MOST_ACCELERATION = 4.0
"""Largest acceleration over c_s^2/r, likewise (`motion.RUNAWAY_ACCELERATION`)."""
MOST_COMPRESSION = 0.2
"""Largest g H/c_s^2 of a column that starts compressed: beyond it layers would sink through each other."""
STEEPEST = 1e18
"""Largest c_s^2/r [m/s^2]: its square still fits into single precision."""
HARDEST = 1e18
"""Largest rho_0 c_s^2 [Pa], likewise."""
FINEST = 1e-8
"""Smallest spacing [m]: the slope of a kernel, 1/r^4, still fits into single precision."""


def range_faults(scene: SceneScales) -> list[str]:
    """Find what is out of range. Only to be asked of a scene in which nothing else is wrong."""
    if scene.spacing < FINEST:
        return [f"spacing: {scene.spacing:g} is below {FINEST:g} m, where single precision ends; use a larger one"]
    c, r = scene.wave_speed, scene.support
    if not 0.0 < c * c / r <= STEEPEST:
        return [
            f"sound_speed: {c:.3g} m/s over a support radius of {r:g} m makes accelerations of {c * c / r:.3g} m/s^2, more than "
            f"the {STEEPEST:g} that single precision can square; lower speeds and heights, or use a larger spacing"
        ]
    faults = []
    speed = _certain_speed(scene)
    if speed > MOST_MACH * c * (1 + 1e-9):
        faults.append(
            f"sound_speed: {c:g} m/s is too little for fluid that starts, falls or is pushed at up to {speed:.3g} m/s, at most "
            f"{MOST_MACH:g} times as fast; use at least {speed / MOST_MACH:.3g}, better {10.0 * speed:.3g}"
        )
    if scene.rest_density * c * c > HARDEST:
        faults.append(
            f"rest_density: {scene.rest_density:g} kg/m^3 and a sound speed of {c:.3g} m/s make a stiffness of "
            f"{scene.rest_density * c * c:.3g} Pa, more than {HARDEST:g}; lower one of them"
        )
    elif scene.background_pressure > scene.rest_density * c * c:
        faults.append(
            f"background_pressure: {scene.background_pressure:g} Pa is more than the stiffness rho_0 c_s^2 of the fluid, "
            f"{scene.rest_density * c * c:.3g} Pa; lower it, or raise sound_speed"
        )
    limit = MOST_ACCELERATION * c * c / r
    for name, value in _accelerations(scene):
        if value > limit:
            faults.append(
                f"{name}: {value:.3g} m/s^2 exceeds {MOST_ACCELERATION:g} c_s^2/r = {limit:.3g} m/s^2, at which a run counts as "
                "blown up; lower it, or raise sound_speed"
            )
    compression = scene.depth_potential / scene.least_wave_speed**2
    if scene.hydrostatic and compression > MOST_COMPRESSION:
        faults.append(
            f"hydrostatic: the fluid's own weight would compress it by g H/c_s^2 = {compression:.3g}, more than "
            f"{MOST_COMPRESSION:g}; use a sound_speed of at least {math.sqrt(scene.depth_potential / MOST_COMPRESSION):.3g}"
        )
    return faults


def _certain_speed(scene: SceneScales) -> float:
    """Largest speed [m/s] that the scene sets, or that fluid reaches by falling; on periodic axes friction may stop a fall."""
    given = [fluid.top_speed for fluid in scene.fluids] + [math.hypot(*inflow.velocity) for inflow in scene.inflows]
    return max(scene.wall_speed, *given) if any(scene.is_periodic) else scene.estimate_max_speed()


def _accelerations(scene: SceneScales) -> list[tuple[str, float]]:
    """Names and sizes [m/s^2] of what accelerates all fluid."""
    found = [("gravity", math.hypot(*scene.acceleration))]
    if scene.gravity_changes:
        k, largest = max(enumerate(scene.gravity_changes), key=lambda each: math.hypot(*each[1].gravity))
        found.append((f"gravity_changes.{k}", math.hypot(*largest.gravity)))
    if scene.body_force is not None:
        found.append(("body_force", scene.body_force.top_speed(np.array(corners(scene.domain)))))
    return found
