"""What can be wrong between fields of a scene that are each valid: every finding is one line with value, limit and remedy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from taichi_rts.scene.checks.obstacles import obstacle_faults
from taichi_rts.scene.checks.ranges import range_faults
from taichi_rts.scene.checks.size import size_faults
from taichi_rts.scene.fluids.particles import LEAST_DISTANCE, Particles
from taichi_rts.scene.fluids.shape import FluidShape
from taichi_rts.scene.fluids.shapes import separation
from taichi_rts.scene.near_pairs import mean_occupancy, nearest_pair
from taichi_rts.scene.parts.conditions import AXES, face_axis, face_position
from taichi_rts.scene.parts.probes import names
from taichi_rts.scene.scales import SceneScales

MOST_CROWDED = 2.0
"""Particles given one by one may have this many times the lattice's number density on average: compressed water has 1.1."""
WIDEST_SPLINE = 2.75
"""Support ratio up to which the cubic spline holds water at rest with an integrated density.

With a wider one particles fall onto each other in pairs (the pairing instability: Dehnen & Aly 2012), and walls do not hold
them: at r = 2.8s the nearest two of a still pool are 0.5 s apart after 3 s, at 3s they meet, and walls stop 11,000 centres.
"""
SINGLE = 1e-6
"""Share of the domain's size by which they may lie outside of it, as single precision rounds."""


def contradictions(scene: SceneScales) -> list[str]:
    """Find what is wrong between fields that are each valid."""
    faults = size_faults(scene)
    if faults:
        return faults  # whatever looks closer would take memory for so many
    dim = scene.dim
    if scene.gravity is not None and len(scene.gravity) != dim:
        faults.append(f"gravity {scene.gravity} has {len(scene.gravity)} components; the domain has {dim}")
    faults += _support_faults(scene) + _sound_faults(scene) + _body_force_faults(scene) + _condition_faults(scene)
    faults += _place_faults(scene, "probes") + _place_faults(scene, "gauges")
    for k, fluid in enumerate(scene.fluids):
        if len(fluid.lower) != dim:
            faults.append(f"fluids.{k}: has {len(fluid.lower)} components; the domain has {dim}")
            continue
        faults += _fluid_faults(scene, k, fluid)
        for other in range(k):
            if len(scene.fluids[other].lower) == dim:
                faults += _pair_faults(scene, k, other)
    if not faults:
        faults += _particle_faults(scene)
    faults += obstacle_faults(scene)
    if not faults and _guesses_speed(scene) and scene.estimate_max_speed() <= 0.0:
        faults.append("sound_speed: nothing falls or moves at the start, so no default follows; give it a value [m/s]")
    return faults or range_faults(scene)


def _guesses_speed(scene: SceneScales) -> bool:
    """Whether the sound speed follows from an estimate of the largest speed."""
    return not isinstance(scene.sound_speed, (int, float))


def _support_faults(scene: SceneScales) -> list[str]:
    """Find a support that the walls cannot hold water at rest with."""
    walled = scene.walls and not all(scene.is_periodic)
    if (
        scene.density == "continuity"
        and scene.kernel == "cubic_spline"
        and walled
        and scene.support_ratio > WIDEST_SPLINE
    ):
        return [
            f"support_ratio: {scene.support_ratio:g} with kernel 'cubic_spline' and density 'continuity' lets particles fall "
            f"onto each other, and through walls; use at most {WIDEST_SPLINE:g}, or kernel 'wendland_c2'"
        ]
    return []


def _sound_faults(scene: SceneScales) -> list[str]:
    """Find what a regional sound speed does not go with."""
    regional = scene.regional_sound
    if regional is None:
        return []
    faults = []
    if scene.density != "summation":
        faults.append(
            f"sound_speed: a regional one floats the density of reference, which density {scene.density!r} has no use of; "
            "use density 'summation', or give sound_speed a value [m/s]"
        )
    if scene.background_pressure > 0.0:
        faults.append(
            f"sound_speed: a regional one knows no background_pressure, which is {scene.background_pressure:g} [Pa]; "
            "set that to 0, or give sound_speed a value [m/s]"
        )
    return faults


def _body_force_faults(scene: SceneScales) -> list[str]:
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
    if _guesses_speed(scene):
        faults.append(
            "sound_speed: how fast the body_force makes the fluid is not known, so no default follows; "
            "give ten times the largest speed you expect [m/s]"
        )
    return faults


def _condition_faults(scene: SceneScales) -> list[str]:
    """Find what is wrong with periodic axes, moving walls, inflows and changes of gravity."""
    faults = [
        f"periodic: axis {axis!r} does not exist in two dimensions"
        for axis in scene.periodic
        if axis not in AXES[: scene.dim]
    ]
    for name, length, periodic in zip(AXES, scene.domain.size, scene.is_periodic, strict=False):
        if not periodic:
            continue
        if length < 4.0 * scene.support:
            faults.append(
                f"periodic: the domain is {length:g} long along {name!r}; it must hold 4 support radii of {scene.support:g}; "
                f"use a spacing of at most {length / (4.0 * scene.support_ratio):g}"
            )
        elif abs(length / scene.spacing - round(length / scene.spacing)) > 1e-3:
            best = length / round(length / scene.spacing)
            faults.append(
                f"spacing: {scene.spacing} does not divide the periodic length {length:g} along {name!r}; use {best:.9g}"
            )
    for k, wall in enumerate(scene.moving_walls):
        axis = face_axis(wall.face)
        if axis >= scene.dim or scene.is_periodic[axis] or not scene.walls:
            faults.append(f"moving_walls.{k}: the domain has no wall {wall.face!r}; choose another face")
        elif wall.velocity is not None and len(wall.velocity) != scene.dim:
            faults.append(
                f"moving_walls.{k}: velocity has {len(wall.velocity)} components; the domain has {scene.dim}, give as many"
            )
        elif any(wall.velocity or ()) and max(scene.viscosities) == 0.0:
            faults.append(
                f"moving_walls.{k}: face {wall.face!r} slides by friction alone, and kinematic_viscosity is 0; "
                "give one above 0 [m^2/s], or leave velocity out"
            )
        elif max(map(abs, wall.displacements)) > scene.domain.size[axis] - scene.support:
            faults.append(
                f"moving_walls.{k}: {wall.face!r} would close the domain; leave at least {scene.support:g} [m]"
            )
    if len({wall.face for wall in scene.moving_walls}) < len(scene.moving_walls):
        faults.append("moving_walls: two of them are the same face; join their times")
    for k, inflow in enumerate(scene.inflows):
        if len(inflow.lower) != scene.dim:
            faults.append(f"inflows.{k}: has {len(inflow.lower)} components; the domain has {scene.dim}")
            continue
        place = inflow.lower[inflow.axis]
        if scene.is_periodic[inflow.axis] or abs(place - face_position(inflow.face, scene.domain)) > _slack(scene):
            faults.append(
                f"inflows.{k}: the patch must lie on face {inflow.face!r} of the domain, where its velocity points inwards"
            )
        for d in range(scene.dim):
            if d != inflow.axis and inflow.upper[d] - inflow.lower[d] < scene.spacing * (1 - 1e-6):
                faults.append(f"inflows.{k}: the patch is narrower than the spacing {scene.spacing}; widen it")
            if inflow.lower[d] < scene.domain.lower[d] - _slack(scene) or inflow.upper[d] > scene.domain.upper[
                d
            ] + _slack(scene):
                faults.append(f"inflows.{k}: the patch leaves the domain; shrink it")
    faults += _outlet_faults(scene)
    times = [change.time for change in scene.gravity_changes]
    if times != sorted(set(times)):
        faults.append(f"gravity_changes: times {times} must ascend")
    for k, change in enumerate(scene.gravity_changes):
        if len(change.gravity) != scene.dim:
            faults.append(
                f"gravity_changes.{k}: gravity has {len(change.gravity)} components; the domain has {scene.dim}"
            )
    return faults


def _outlet_faults(scene: SceneScales) -> list[str]:
    """Find outlets that lie outside the domain, are so thin that fluid may cross them, or take what an inflow lets in."""
    faults = []
    for k, outlet in enumerate(scene.outlets):
        if len(outlet.lower) != scene.dim:
            faults.append(f"outlets.{k}: has {len(outlet.lower)} components; the domain has {scene.dim}")
            continue
        for d in range(scene.dim):
            low, high = outlet.lower[d], outlet.upper[d]
            if low < scene.domain.lower[d] - _slack(scene) or high > scene.domain.upper[d] + _slack(scene):
                faults.append(f"outlets.{k}: the box leaves the domain along {AXES[d]!r}; shrink it")
            if high - low < scene.support * (1 - 1e-6):
                faults.append(
                    f"outlets.{k}: the box is {high - low:g} thick along {AXES[d]!r}, and fluid may cross it unseen; "
                    f"make it at least a support radius, {scene.support:g}"
                )
        for n, inflow in enumerate(scene.inflows):
            near = zip(inflow.lower, outlet.upper, outlet.lower, inflow.upper, strict=False)
            if len(inflow.lower) == scene.dim and all(a <= b and c <= d for a, b, c, d in near):
                faults.append(f"outlets.{k}: takes out what inflows.{n} lets in; move one of them")
    return faults


def _place_faults(scene: SceneScales, kind: str) -> list[str]:
    """Find what is wrong with the scene's `kind`, probes or gauges."""
    faults = []
    places: Any = getattr(scene, kind)
    for k, place in enumerate(places):
        x, low, high = place.position, scene.domain.lower, scene.domain.upper
        if len(x) != scene.dim:
            faults.append(f"{kind}.{k}: has {len(x)} components; the domain has {scene.dim}")
        elif not all(a - _slack(scene) <= b <= c + _slack(scene) for a, b, c in zip(low, x, high, strict=True)):
            faults.append(f"{kind}.{k}: {x} lies outside the domain from {low} to {high}; move it")
    found = names(places)
    if twice := sorted({name for name in found if found.count(name) > 1}):
        faults.append(f"{kind}: two of them have the name {twice[0]!r}; rename one")
    return faults


def _particle_faults(scene: SceneScales) -> list[str]:
    """Find particles that are too near to each other, or were made with a smaller spacing."""
    given = {k: fluid for k, fluid in enumerate(scene.fluids) if isinstance(fluid, Particles)}
    faults = []
    for k, fluid in given.items():
        spacing = fluid.spacing
        if spacing is not None and abs(spacing / scene.spacing - 1.0) > 1e-6:
            faults.append(
                f"spacing: {scene.spacing} is not the {spacing:.9g} with which the particles of fluids.{k} were made; use that"
            )
            continue
        crowd = mean_occupancy(fluid.positions, scene.support) / scene.support_ratio**scene.dim
        if crowd > MOST_CROWDED:
            faults.append(
                f"spacing: {scene.spacing} is too large for the particles of fluids.{k}, which lie {crowd:.3g} times as close "
                f"as that makes; use about {scene.spacing * crowd ** (-1.0 / scene.dim):.3g}"
            )
    limit = LEAST_DISTANCE * scene.spacing
    if len(given) == 1:
        pair = next(iter(given.values())).nearest_pair(limit)
    else:
        pair = nearest_pair(np.concatenate([fluid.positions for fluid in given.values()]), limit) if given else None
    if pair and not faults:
        owners = [f"{n} of fluids.{k}" for k, fluid in given.items() for n in range(fluid.count)]
        faults.append(
            f"particles {owners[pair[1]]} and {owners[pair[2]]} lie {pair[0]:.3g} apart, nearer than {LEAST_DISTANCE:g} spacings "
            f"{limit:.3g}; remove one of them"
        )
    return faults


def _fluid_faults(scene: SceneScales, k: int, fluid: FluidShape) -> list[str]:
    faults = []
    slack = SINGLE * max(scene.domain.size) if isinstance(fluid, Particles) else _slack(scene)
    low = all(a >= b - slack for a, b in zip(fluid.lower, scene.domain.lower, strict=True))
    high = all(a <= b + slack for a, b in zip(fluid.upper, scene.domain.upper, strict=True))
    if not (low and high):
        faults.append(
            f"fluids.{k}: {fluid.outline} leaves the domain from "
            f"{scene.domain.lower} to {scene.domain.upper}; move or shrink it, or enlarge the domain"
        )
    if fluid.extent is None:
        return faults
    name, least = fluid.extent
    if least < scene.spacing * (1 - 1e-6):
        faults.append(f"spacing: {scene.spacing} exceeds the {name} {least:g} of fluids.{k}; use at most {least:g}")
    return faults


def _pair_faults(scene: SceneScales, k: int, other: int) -> list[str]:
    one, two = scene.fluids[k], scene.fluids[other]
    gap = separation(one, two)
    slack = _slack(scene)
    if gap < -slack:
        return [f"fluids.{k}: overlaps fluids.{other}; move one of them"]
    # A sphere's particles may lie on its surface, a block's stay half a spacing inside: only two spheres' can coincide.
    may_coincide = not one.keeps_inside and not two.keeps_inside
    if may_coincide and gap < 0.5 * scene.spacing - slack:
        return [
            f"fluids.{k}: lies {max(gap, 0.0):g} from fluids.{other}, nearer than half a spacing {0.5 * scene.spacing:g}, "
            "so that particles could coincide; move one of them or use a smaller spacing"
        ]
    return []


def _slack(scene: SceneScales) -> float:
    corners = (*scene.domain.lower, *scene.domain.upper)
    return 1e-9 * max(scene.domain.size) + 4.0 * math.ulp(max(map(abs, corners)))  # for lengths [m] that rounding blurs
