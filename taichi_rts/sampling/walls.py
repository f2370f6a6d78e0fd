"""Wall particles: how deep they lie, and what volume they have; and those inside obstacles. Those of the domain: `faces.py`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taichi_rts.medium.smoothing import lattice_sum, make_kernel
from taichi_rts.sampling.lining import line_solid, neighbours, shares
from taichi_rts.scene.geometry.spanning import scene_solid, spans
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.scene import Scene
from taichi_rts.scene.validation import Vector

CONTINUED_LATTICE = 1.0
WALL_STIFFNESS = 4.0 / 3.0
"""How much steeper a wall's density profile is than the lattice's it replaces (see `calibrate_walls`).

1 continues the lattice: a pool 10 particles deep settles 3.5 % too low, and 2,300 centres hit the faces of the domain in a
double dam break. 2 balances a particle at rest on the wall exactly, but is so stiff that the same dam break throws particles
at 47 m/s at courant 0.4 and blows up at 0.6. 4/3 settles 1.2 % too low, keeps every centre off the faces, and survives both
(docs/evidence/defaults.md).
Wider supports have flatter profiles, so there the factor grows with r/2s (`wall_stiffness`).
With an integrated density the walls' pressure is mirrored and 1 is right (`continuity.MirroredPressure`).
"""
EVEN_SWEEPS = 20
MOST_SCALED = 2.5


@dataclass(frozen=True)
class WallLayer:
    """Wall particles behind faces of the domain: positions [m] and normals into the fluid, (M, dim), volumes [m^dim], (M,).

    They lie `depths` [m], (M,), behind their face, the plane nearest to it `depth` [m]; `stiffness` is that of
    `calibrate_walls`.
    """

    positions: np.ndarray
    normals: np.ndarray
    volumes: np.ndarray
    depths: np.ndarray
    depth: float
    stiffness: float

    def choose(self, mask: np.ndarray) -> WallLayer:
        """Return those that `mask`, (M,), names."""
        chosen = {name: getattr(self, name)[mask] for name in ("positions", "normals", "volumes", "depths")}
        return replace(self, **chosen)

    def joined(self, others: Sequence[WallLayer]) -> WallLayer:
        """Return these and those of `others`, which have the same stiffness, behind them."""
        layers = [self, *others] if len(self.positions) else list(others) or [self]
        return replace(
            layers[0],
            positions=np.concatenate([layer.positions for layer in layers]),
            normals=np.concatenate([layer.normals for layer in layers]),
            volumes=np.concatenate([layer.volumes for layer in layers]),
            depths=np.concatenate([layer.depths for layer in layers]),
        )


def line_obstacles(scene: Scene, solids: Sequence[Solid]) -> tuple[WallLayer, ...]:
    """Wall particles below the surface of each obstacle: at the depth and with the volume of `calibrate_walls`.

    In as many layers as the domain's walls, where the body has room for them: those of one layer lie at least 0.8 spacings
    deeper than the layer before, so that none meets another from the other side.

    Where they are closer than in the domain's walls, or further apart, their volumes are less, or more (`lining.shares`), and
    where the surface bends or the body is thin, such that fluid half a spacing away sees as much as at a plane wall. Those of
    obstacles at rest are left out where the domain ends and inside other obstacles at rest, which have their own.
    """
    if not solids:
        return ()
    s = scene.spacing
    depth, volume = calibrate_walls(scene)
    kernel = make_kernel(scene.kernel, scene.dim, scene.support)
    seen = volume * planes_sum(scene)(0.5 * s + depth)
    at_rest = [obstacle.motion is None for obstacle in scene.obstacles]
    layers = []
    for k, solid in enumerate(solids):
        around = spans(scene, scene.obstacles[k])
        if around.any():  # so long that its lattice goes on from one end of the domain to the other
            solid = scene_solid(scene, scene.obstacles[k], depth + 3.5 * s)
        laid = [line_solid(solid, depth, s)]
        laid += [line_solid(solid, deep, s, least=deep - 0.2 * s) for deep in plane_depths(scene, depth)[1:]]
        x, normals = (np.concatenate(parts) for parts in zip(*laid, strict=True))
        inside = solid.distance(x)
        if scene.wall_planes > 1:
            lost = np.linalg.norm(normals, axis=1) < 0.5  # amid a thin body neither side is nearer: either will do
            aside = 0.05 * s * np.array([1.0, 0.8, 0.6])[: scene.dim]
            normals[lost] = solid.normals(x[lost] + aside, 0.01 * s)
        probes = x + (0.5 * s - inside)[:, None] * normals
        share = np.concatenate([shares(part, s) for part, _ in laid])
        volumes = even_out(kernel, x, volume * share, probes, seen)
        depths = np.full(len(x), depth) if scene.wall_planes == 1 else np.minimum(-inside, scene.support)
        layer = WallLayer(x, normals, volumes, depths, depth, wall_stiffness(scene))
        if at_rest[k]:
            kept = np.asarray(((x >= scene.domain.lower) & (x <= scene.domain.upper)).all(axis=1))
            low, high = x.min(axis=0), x.max(axis=0)
            for other, its in zip(solids[:k], at_rest, strict=False):
                if its and (other.lower < high).all() and (other.upper > low).all():
                    kept &= other.distance(x) > -0.99 * depth
            layer = layer.choose(kept)
        if around.any():
            inside = (x >= np.array(scene.domain.lower)) & (x < np.array(scene.domain.upper))
            layer = layer.choose((inside | ~around).all(axis=1))
        layers.append(layer)
    return tuple(layers)


def even_out(kernel: Any, x: np.ndarray, volumes: np.ndarray, probes: np.ndarray, seen: float) -> np.ndarray:
    """Volumes [m^dim], (M,), for which the sum of V_b W at each of the `probes`, (M, dim), above the particles is `seen`.

    Found by scaling each by what its probe lacks, again and again, and never by more than `MOST_SCALED` in all.
    """
    near = neighbours(x, probes, 2.0 * kernel.h)
    weights = [kernel.sample(np.linalg.norm(x[n] - y, axis=1)) for n, y in zip(near, probes, strict=True)]
    scaled = volumes
    for _ in range(EVEN_SWEEPS):
        found = np.array([w @ scaled[n] for n, w in zip(near, weights, strict=True)])
        scaled = np.clip(scaled * (seen / found) ** 0.7, volumes / MOST_SCALED, volumes * MOST_SCALED)
    return scaled


def wall_stiffness(scene: Scene) -> float:
    """How much steeper the walls' density profile is than the lattice's, for the scene's formulation of density.

    At r = 3s, where the lattice's profile is half as steep as at 2s, a still pool pushes some centres through walls that are
    4/3 as steep as it, and none through walls twice as steep (tests/validation/test_wide_supports.py).
    """
    return CONTINUED_LATTICE if scene.density == "continuity" else WALL_STIFFNESS * max(1.0, 0.5 * scene.support_ratio)


def calibrate_walls(scene: Scene) -> tuple[float, float]:
    """Depth [m] of the first plane of a wall behind its face and volume V_b [m^dim] of all its particles, for a resting lattice.

    The lattice's nearest layer, half a spacing from the face, must have its rest density, so the wall replaces what the missing
    half of the lattice would add: V S(d) = D m/rho_0. S(d) is the sum of W over the wall's planes, the first at distance d,
    D the sum over the missing layers. And the wall should carry it: where it pushes with p_i alone and the missing half would
    push with p_i and p_j, its slope has to be steeper: S'(d)/S(d) = `wall_stiffness` D'/D. The two give d, then V.
    """
    s, dim, r = scene.spacing, scene.dim, scene.support
    kernel = make_kernel(scene.kernel, dim, r)
    reach = math.ceil(scene.support_ratio)
    plane, laid = plane_sum(scene), planes_sum(scene)

    def slope(function: Callable[[float], float], d: float) -> float:
        step = 1e-4 * s
        return (function(d + step) - function(d - step)) / (2 * step)

    def missing(d: float) -> float:
        return sum(plane(d + k * s) for k in range(reach))

    wanted = wall_stiffness(scene) * slope(missing, s) / missing(s)
    near, far = s, 0.95 * r
    for _ in range(60):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if slope(laid, middle) / laid(middle) > wanted else (near, middle)
    return near - 0.5 * s, missing(s) / (laid(near) * lattice_sum(kernel, (s,) * dim))


def face_volume(scene: Scene, steps: Vector, axis: int, depth: float, volume: float) -> float:
    """Volume V_b [m^dim] of wall particles at the faces across `axis`, for a fluid whose rows are `steps` [m], (dim,), apart.

    `depth` [m] and `volume` [m^dim] are those of `calibrate_walls`. As it has it, V S(d) = D m/rho_0, at that depth.
    """
    if steps == (scene.spacing,) * scene.dim:
        return volume
    across, along = steps[axis], (*steps[:axis], *steps[axis + 1 :])
    plane, laid = plane_sum(scene, along), planes_sum(scene, along)
    missing = sum(plane((k + 1) * across) for k in range(math.ceil(scene.support / across)))
    kernel = make_kernel(scene.kernel, scene.dim, scene.support)
    return missing / (laid(depth + 0.5 * across) * lattice_sum(kernel, steps))


def plane_sum(scene: Scene, along: Sequence[float] = ()) -> Callable[[float], float]:
    """Return S(d): the sum of W over a plane of a lattice at distance d [m].

    Its rows are `along` [m], (dim - 1,), apart, by default the scene's spacing.
    """
    kernel = make_kernel(scene.kernel, scene.dim, scene.support)
    sides = along or (scene.spacing,) * (scene.dim - 1)
    reaches = [math.ceil(scene.support / side) for side in sides]
    rows = [side * np.arange(-reach, reach + 1) for side, reach in zip(sides, reaches, strict=True)]
    lateral2 = sum(g**2 for g in np.meshgrid(*rows))
    return lambda d: float(kernel.sample(np.sqrt(lateral2 + d * d)).sum())


def plane_depths(scene: Scene, depth: float) -> np.ndarray:
    """Depths [m] of a wall's planes, of which the first lies `depth` [m] deep: those that anything in front can reach.

    What lies deeper than r would have no effect, and no place in the grid's margin.
    """
    depths = depth + scene.spacing * np.arange(scene.wall_planes)
    return depths[depths < scene.support]


def planes_sum(scene: Scene, along: Sequence[float] = ()) -> Callable[[float], float]:
    """Return the sum of `plane_sum` over all planes of a wall, as a function of the distance d [m] of the first."""
    plane, s, count = plane_sum(scene, along), scene.spacing, scene.wall_planes
    return lambda d: sum(plane(d + k * s) for k in range(count))
