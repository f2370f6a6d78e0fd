"""Obstacles on the device: what keeps centres out of them, and wall particles that move and turn with them."""

from dataclasses import replace

import numpy as np

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.fields import Declared, Part, reals
from taichi_rts.sampling.walls import WallLayer
from taichi_rts.scene.geometry.bodies import Body
from taichi_rts.scene.obstacles.solid import DistanceGrid
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.physics.path import Path
from taichi_rts.solver.physics.timetable import store
from taichi_rts.solver.physics.walls import Walls

PROJECTIONS = 4  # of a point that is inside: the distance is not linear at edges


@ti.data_oriented
class Keeper(Part):
    """Keeps the centres of particles out of an obstacle, as the domain's box keeps them in; `body`: None if it is at rest."""

    def __init__(self, grid: DistanceGrid, geometry: Geometry, body: Body | None = None) -> None:
        self.geometry = geometry
        self.dim = geometry.dim
        self.moves = body is not None
        if body is not None:
            self.path = Path(body)
        self.origin = tuple(grid.origin.tolist())
        self.scale = 1.0 / grid.step
        self.shape = grid.values.shape
        self.make_fields(self.fields(self.shape))
        store(self.values, grid.values)

    @staticmethod
    def fields(nodes: tuple[int, ...]) -> list[Declared]:
        """Declare the table of distances at `nodes`, (dim,), along each axis."""
        return reals(nodes, "values")

    @ti.func
    def look(self, x):
        """Signed distance [m] from the body at time 0 and its gradient, interpolated linearly; 0 gradient off the grid."""
        place = (x - ti.Vector(self.origin)) * self.scale
        near = True
        base = ti.Vector.zero(ti.i32, self.dim)
        share = ti.zero(x)
        for d in ti.static(range(self.dim)):
            near = near and place[d] >= 0.0 and place[d] < ti.static(self.shape[d] - 1.0)
            base[d] = ti.min(ti.max(ti.cast(ti.floor(place[d]), ti.i32), 0), ti.static(self.shape[d] - 2))
            share[d] = place[d] - ti.cast(base[d], float)
        distance, gradient = 1.0, ti.zero(x)
        if near:
            distance = 0.0
            for corner in ti.static(list(np.ndindex(*[2] * self.dim))):
                value = self.values[base + ti.Vector(corner)]
                weight = 1.0
                for d in ti.static(range(self.dim)):
                    weight *= share[d] if ti.static(corner[d] == 1) else 1.0 - share[d]
                distance += weight * value
                for d in ti.static(range(self.dim)):
                    slope = self.scale if ti.static(corner[d] == 1) else -self.scale
                    for e in ti.static(range(self.dim)):
                        if ti.static(e != d):
                            slope *= share[e] if ti.static(corner[e] == 1) else 1.0 - share[e]
                    gradient[d] += slope * value
        return distance, gradient

    @ti.func
    def hold(self, x, now, tick, ahead):
        """Nearest point to `x` [m] outside the body, and the surface's normal and velocity [m/s] there.

        It is for the time `ahead` [s] after tick `now`.
        """
        held, normal, velocity = x, ti.zero(x), ti.zero(x)
        if ti.static(self.moves):
            pivot, turn = self.path.pose(now, tick, ahead)
            arm = self.geometry.difference(x, pivot)
            if arm.norm_sqr() < ti.static(self.path.radius**2):
                y, n = self.outside(ti.Vector(self.path.pivot) + turn.transpose() @ arm)
                if n.norm_sqr() > 0.0:
                    normal = turn @ n
                    new_arm = turn @ (y - ti.Vector(self.path.pivot))
                    held = x + new_arm - arm
                    straight, spin = self.path.rates(now, tick, ahead)
                    velocity = straight + self.path.carried(spin, new_arm)
        else:
            held, normal = self.outside(x)
        return held, normal, velocity

    @ti.func
    def outside(self, x):
        """Nearest point to `x` [m] outside the body at time 0, and the normal if it is another, else 0."""
        y, normal = x, ti.zero(x)
        for _ in range(PROJECTIONS):
            distance, gradient = self.look(y)
            if distance < 0.0:
                size = ti.max(gradient.norm(), 0.1)
                normal = gradient / size
                y -= (distance / size) * normal
        return y, normal


@ti.data_oriented
class MovingBody(Walls):
    """Wall particles that move and turn together, sorted once in their own frame, whose origin is the body's pivot.

    Fluid is brought into that frame at its own time, so readers at different times see the body each at its own. All
    particles of a block have one time, so the pose is kept for each block.
    """

    moves = True

    def __init__(
        self, body: Body, layer: WallLayer, fluid: Neighbourhood, grid: BlockGrid, support: float, backend: Backend
    ) -> None:
        arms = replace(layer, positions=layer.positions - body.pivot)
        around = self.own_geometry(arms.positions.min(axis=0), arms.positions.max(axis=0), support)
        super().__init__(arms, fluid, around, backend)
        self.grid = grid
        self.domain = grid.geometry
        self.make_fields(self.pose_fields(self.domain.blocks, self.domain.dim))
        self.path = Path(body)

    @staticmethod
    def own_geometry(lower: np.ndarray, upper: np.ndarray, support: float) -> Geometry:
        """Return the blocks around particles between `lower` and `upper` [m], (dim,), as seen from the pivot."""
        return Geometry((lower - 2.0 * support).tolist(), (upper + 2.0 * support).tolist(), support)

    @staticmethod
    def pose_fields(blocks: int, dim: int) -> list[Declared]:
        """Declare the pose for each of the domain's `blocks`."""
        shapes = {"pivot": (dim,), "velocity": (dim,), "turn": (dim, dim), "spin": (1 if dim == 2 else 3,)}
        return [Declared(name, float, blocks, shape) for name, shape in shapes.items()]

    @ti.func
    def block(self, k):
        """Block of the particle at place `k`."""
        return self.grid.block(self.grid.order[k])

    @ti.func
    def observe(self, k, now, tick):
        """Note where the body is for the due particle at place `k`, which is at tick `now` like all of its block."""
        n = self.block(k)
        self.pivot[n], self.turn[n] = self.path.pose(now, tick, 0.0)
        self.velocity[n], self.spin[n] = self.path.rates(now, tick, 0.0)

    @ti.func
    def seen_from(self, k, cell):
        """Position [m] and cell, in the body's frame, of the due particle at place `k`."""
        n = self.block(k)
        x = self.geometry.place(self.turn[n].transpose() @ self.domain.difference(self.fluid.x[k], self.pivot[n]))
        return x, self.geometry.cell(x)

    @ti.func
    def difference(self, k, b):
        """x_k - x_b [m], as the world sees it, between the due particle at place `k` and wall particle `b`."""
        n = self.block(k)
        return self.domain.difference(self.fluid.x[k], self.pivot[n]) - self.turn[n] @ self.x[b]

    @ti.func
    def relative_velocity(self, k, b):
        """v_k - v_b [m/s]."""
        n = self.block(k)
        return self.fluid.v[k] - self.velocity[n] - self.path.carried(self.spin[n], self.turn[n] @ self.x[b])

    @ti.func
    def facing(self, k, b):
        """Normal of wall particle `b`, as the world sees it at the time of the particle at place `k`."""
        return self.turn[self.block(k)] @ self.normal[b]
