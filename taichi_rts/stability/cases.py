"""Hard cases: small scenes, each with one difficulty for solvers, that end as soon as it is over.

Most share a tank, a spacing and a sound speed, so that speeds can be read as Mach numbers. To add one, write a function that
returns a scene and list it in `CASES`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import taichi_rts as rts
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.stepping import criteria

S = 0.05  # spacing [m]
C = 40.0  # sound speed [m/s]
G = 9.81  # gravity [m/s^2]
VISCOUS_SHARE = 0.1  # viscous over acoustic limit in `viscous_blob`
COURANT = 0.4  # at which that acoustic limit is meant


@dataclasses.dataclass(frozen=True)
class Case:
    """A hard case.

    Attributes:
        name: its name on the command line.
        what: what happens in it, and why that is hard.
        build: returns the scene.
        shocks: whether shocks meet single particles, whose density then overshoots the jump however short the steps are (see
            `suite.reference_density`), and which have to be looked at more often to be seen.
    """

    name: str
    what: str
    build: Callable[[], Scene]
    shocks: bool = False

    @property
    def samples(self) -> int:
        """How often to look at a run."""
        return 160 if self.shocks else 40

    @property
    def scene(self) -> Scene:
        """The scene, under the case's name."""
        return self.build().replace(name=self.name, description=self.what)


def tank(width: float, height: float, *fluids: Any, **changes: Any) -> Scene:
    """Return a two-dimensional scene in a tank of `width` x `height` [m]."""
    fields: dict[str, Any] = {
        "domain": rts.Box((0, 0), (width, height)),
        "fluids": fluids,
        "spacing": S,
        "sound_speed": C,
    }
    return Scene(**(fields | changes))


def impact_on_pool(mach: float, **changes: Any) -> Scene:
    """A block falls on a pool of its own depth."""
    block = rts.Block((0.6, 0.45), (1.0, 0.85), velocity=(0, -mach * C))
    return tank(1.6, 1.2, rts.Block((0, 0), (1.6, 0.4)), block, end_time=0.1, **changes)


def impact_on_wall(mach: float) -> Scene:
    """A block falls on the bare floor."""
    return tank(1.6, 1.2, rts.Block((0.6, 0.1), (1.0, 0.5), velocity=(0, -mach * C)), end_time=0.1)


def impact_3d(mach: float, pool: bool) -> Scene:
    """The same in three dimensions and coarser, on a pool or on the floor."""
    s, pools = 0.1, [rts.Block((0, 0, 0), (1, 0.3, 1))] if pool else []
    floor = 0.4 if pool else 0.1
    block = rts.Block((0.3, floor, 0.3), (0.7, floor + 0.4, 0.7), velocity=(0, -mach * C, 0))
    domain = rts.Box((0, 0, 0), (1, 1, 1))
    return Scene(domain=domain, fluids=(*pools, block), spacing=s, sound_speed=C, end_time=0.1)


def head_on(mach: float) -> Scene:
    """Two blocks meet without gravity."""
    left = rts.Block((0.2, 0.4), (0.75, 0.8), velocity=(mach * C, 0))
    right = rts.Block((0.85, 0.4), (1.4, 0.8), velocity=(-mach * C, 0))
    return tank(1.6, 1.2, left, right, gravity=(0, 0), end_time=0.1)


def still_pool(end_time: float, **changes: Any) -> Scene:
    """A pool 8 particles deep; coarse, because it takes the most steps of all."""
    return tank(16, 12, rts.Block((0, 0), (16, 8)), spacing=1.0, sound_speed=None, end_time=end_time, **changes)


def deep_column() -> Scene:
    """A column of 60 support radii, two periods 4 H/c_s of its pressure wave."""
    height = 60 * 2 * S
    speed = 10 * math.sqrt(2 * G * height)
    column = rts.Block((0, 0), (4 * S, height))
    return tank(4 * S, height + 10 * S, column, sound_speed=speed, end_time=8 * height / speed)


def sheet() -> Scene:
    """A sheet of one particle's thickness falls flat on the floor."""
    return tank(2, 0.5, rts.Block((0, 0.2), (2, 0.2 + S)), end_time=0.5)


def lone_particles() -> Scene:
    """Single particles: at rest on the floor, falling, thrown at a wall and at each other at Mach 0.3."""
    places = {(0.1, 0): (0, 0), (0.3, 0.5): (0, 0), (0.5, 0.2): (-12, 3), (0.6, 0.7): (12, 0), (0.9, 0.7): (-12, 0)}
    particles = [rts.Block(at, (at[0] + S, at[1] + S), velocity=v) for at, v in places.items()]
    return tank(1, 1, *particles, end_time=0.5)


def jet_into_corner() -> Scene:
    """A jet 4 particles wide flows in and runs along the floor into a corner at Mach 0.3."""
    velocity = (-0.3 * C, 0)
    flow = rts.Inflow((2, 0), (2, 0.2), velocity)
    return tank(2, 1.6, rts.Block((0.3, 0), (2, 0.2), velocity=velocity), inflows=(flow,), end_time=0.2)


def drop_in_gap() -> Scene:
    """A drop falls on two shelves with a gap 3 particles wide between them, and through it to the floor."""
    edge = 0.5 - 1.5 * S
    shelves = rts.BoxObstacle((0, 0.6), (edge, 0.8)), rts.BoxObstacle((1 - edge, 0.6), (1, 0.8))
    return tank(1, 1.6, rts.Block((0.3, 1.0), (0.7, 1.4)), sound_speed=53.0, obstacles=shelves, end_time=0.8)


def viscous_blob() -> Scene:
    """A blob whose viscous limit is a tenth of the acoustic one falls into thin water."""
    support = 2 * S
    nu = criteria.viscous_step(support, 1.0) / (VISCOUS_SHARE * criteria.acoustic_step(COURANT, support, C))
    blob: dict[str, Any] = {"velocity": (0, -2), "kinematic_viscosity": nu}
    return tank(1, 1, rts.Block((0, 0), (1, 0.3)), rts.Block((0.3, 0.35), (0.7, 0.75), **blob), end_time=0.3)


def piston() -> Scene:
    """A wall that suddenly starts to move, at Mach 0.1, and stops as suddenly."""
    start, stop, way = 0.02, 0.095, 0.3
    wall = rts.MovingWall(face="x-", times=(0.0, start, stop), displacements=(0.0, 0.0, way))
    return tank(1.2, 1, rts.Block((0, 0), (1.2, 0.4)), moving_walls=(wall,), end_time=0.2)


def gravity_flip() -> Scene:
    """Gravity turns upside down, and the pool falls on the lid."""
    change = rts.GravityChange(0.1, (0, G))
    return tank(1, 1, rts.Block((0, 0), (1, 0.4)), gravity_changes=(change,), sound_speed=45.0, end_time=0.7)


def dam(spacing: float, origin: tuple[float, float] = (0, 0), hurry: float = 1.0) -> Scene:
    """A dam of 8 x 12 particles breaks, at any `spacing` [m] and `origin` [m], and all times over `hurry`."""
    x, y = origin
    block = rts.Block((x, y), (x + 8 * spacing, y + 12 * spacing))
    domain = rts.Box(origin, (x + 24 * spacing, y + 20 * spacing))
    end = 6 * math.sqrt(12 * spacing / G) / hurry
    return Scene(domain=domain, fluids=(block,), spacing=spacing, gravity=(0, -G * hurry**2), end_time=end)


MACHS = (0.3, 0.5, 0.7)
GENTLE = (0.2, 0.26, 0.3)
"""Cases in which blocks still take long steps when they meet, so that the impact has to be noticed in time."""
CASES: tuple[Case, ...] = (
    *(Case(f"pool_impact_{m}", f"block on a pool at Mach {m}", partial(impact_on_pool, m), shocks=True) for m in MACHS),
    Case(
        "pool_impact_continuity",
        "block on a pool at Mach 0.5, density integrated",
        partial(impact_on_pool, 0.5, density="continuity"),
        shocks=True,
    ),
    *(Case(f"wall_impact_{m}", f"block on a wall at Mach {m}", partial(impact_on_wall, m), shocks=True) for m in MACHS),
    *(
        Case(f"wall_impact_{m}", f"block on a wall at Mach {m}", partial(impact_on_wall, m), shocks=True)
        for m in GENTLE[:2]
    ),
    *(Case(f"head_on_{m}", f"two blocks head-on, each at Mach {m}", partial(head_on, m), shocks=True) for m in GENTLE),
    Case("head_on", "two blocks head-on, each at Mach 0.5", partial(head_on, 0.5), shocks=True),
    Case("pool_impact_3d", "block on a pool at Mach 0.5, 3D", partial(impact_3d, 0.5, True), shocks=True),
    Case("wall_impact_3d", "block on a wall at Mach 0.5, 3D", partial(impact_3d, 0.5, False), shocks=True),
    Case("still_pool", "still pool for 20 s", partial(still_pool, 20.0)),
    Case(
        "still_pool_continuity",
        "still pool for 5 s, density integrated",
        partial(still_pool, 5.0, density="continuity"),
    ),
    Case("deep_column", "column 60 support radii deep", deep_column),
    Case("sheet", "sheet of one particle falls flat", sheet),
    Case("lone_particles", "single particles, some at Mach 0.3", lone_particles),
    Case("corner_jet", "jet into a corner at Mach 0.3", jet_into_corner, shocks=True),
    Case("gap", "drop through a gap of 3 particles", drop_in_gap),
    Case("viscous_blob", "very viscous blob in thin water", viscous_blob),
    Case("piston", "wall that starts to move at Mach 0.1", piston, shocks=True),
    Case("gravity_flip", "gravity that flips", gravity_flip, shocks=True),
    Case("tiny", "dam break with a spacing of 1e-4 m", partial(dam, 1e-4)),
    Case("huge", "dam break with a spacing of 10 m", partial(dam, 10.0)),
    Case("far", "dam break 1 km from the origin", partial(dam, S, (1000.0, -1000.0))),
    Case("fast", "dam break at 1/1000 of the time scale", partial(dam, S, (0.0, 0.0), 1000.0)),
)
"""All cases, in the order of the map's rows."""
