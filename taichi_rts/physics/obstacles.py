"""Obstacles on the device: what keeps centres out of them, and wall particles that move and turn with them."""

import math
from dataclasses import replace

import numpy as np
import taichi as ti

from taichi_rts.backend import Backend
from taichi_rts.bodies import Body
from taichi_rts.grid import BlockGrid, Geometry
from taichi_rts.particles import Neighbourhood
from taichi_rts.physics.timetable import Timetable, Wheel, store
from taichi_rts.physics.walls import Walls
from taichi_rts.sampling import WallLayer
from taichi_rts.solids import DistanceGrid

PROJECTIONS = 4  # of a point that is inside: the distance is not linear at edges


@ti.data_oriented
class Path:
    """Where a moving body is, as a function of time alone: a reader at any time may ask, `ahead` [s] after tick `now`."""

    def __init__(self, body: Body) -> None:
        pieces = body.pieces
        self.dim = dim = len(body.pivot)
        count = len(pieces.starts)
        self.pivot = tuple(body.pivot.tolist())
        self.radius = body.radius
        self.periods = body.periods
        self.table = Timetable(pieces.starts, pieces.durations)
        speeds = pieces.spins[:, 0] if dim == 2 else np.linalg.norm(pieces.spins, axis=1)
        self.wheel = Wheel(speeds / (2.0 * math.pi))
        lengths = np.array([length or math.inf for length in self.periods])
        shifts = pieces.shifts.copy()
        around = np.isfinite(lengths)
        shifts[:, around] -= lengths[around] * np.rint(shifts[:, around] / lengths[around])
        shares = pieces.velocities / lengths
        self.rounds = [Wheel(shares[:, d]) if around[d] else None for d in range(dim)]
        """Along periodic axes: how far the body has come, in lengths of the domain."""
        self.top_speed = ti.field(float, count)
        self.shift, self.velocity = (ti.Vector.field(dim, float, count) for _ in range(2))
        self.spin = ti.Vector.field(pieces.spins.shape[1], float, count)
        self.axis = ti.Vector.field(pieces.spins.shape[1], float, count)
        """Direction of the angular velocity; in two dimensions the wheel knows the sign."""
        self.turn = ti.Matrix.field(dim, dim, float, count)
        axes = np.ones((count, 1)) if dim == 2 else pieces.spins / np.where(speeds > 0.0, speeds, 1.0)[:, None]
        values = (body.speeds, shifts, pieces.velocities, pieces.spins, axes, pieces.turns)
        fields = (self.top_speed, self.shift, self.velocity, self.spin, self.axis, self.turn)
        for field, value in zip(fields, values, strict=True):
            store(field, value)

    @ti.func
    def pose(self, now, tick, ahead):
        """Place of the pivot [m], along periodic axes of one of its images, and rotation."""
        n = self.table.piece(now, tick, ahead)
        ticks, rest = self.table.lasted(n, now, tick, ahead)
        pivot = ti.Vector(self.pivot) + self.shift[n]
        passed = ti.cast(ticks, float) * tick + rest
        for d in ti.static(range(self.dim)):
            if ti.static(self.periods[d] > 0.0):
                pivot[d] += self.periods[d] * self.rounds[d].share(n, ticks, rest)
            else:
                pivot[d] += passed * self.velocity[n][d]
        return pivot, self.turned(self.axis[n], self.wheel.share(n, ticks, rest)) @ self.turn[n]

    @ti.func
    def turned(self, axis, turns):
        """Matrix of a rotation by `turns`, of which no more than half is given: sines of large angles are wrong on a GPU."""
        angle = ti.static(2.0 * math.pi) * turns
        c, s = ti.cos(angle), ti.sin(angle)
        result = ti.Matrix.identity(float, self.dim)
        if ti.static(self.dim == 2):
            result = ti.Matrix([[c, -s], [s, c]])
        else:
            u = axis
            cross = ti.Matrix([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
            result += s * cross + (1.0 - c) * (cross @ cross)
        return result

    @ti.func
    def rates(self, now, tick, ahead):
        """Velocity [m/s] of the pivot and angular velocity [rad/s]."""
        n = self.table.piece(now, tick, ahead)
        moves = ti.cast(self.table.lasts(n, now, tick, ahead), float)
        return moves * self.velocity[n], moves * self.spin[n]

    @ti.func
    def carried(self, spin, arm):
        """Velocity [m/s] at `arm` [m] from the pivot that `spin` [rad/s] gives."""
        v = arm
        if ti.static(self.dim == 2):  # noqa: SIM108  (both sides of an expression would be compiled)
            v = ti.Vector([-spin[0] * arm[1], spin[0] * arm[0]])
        else:
            v = spin.cross(arm)
        return v

    @ti.func
    def speed_until(self, now, tick, horizon):
        """Largest speed [m/s] of the body from tick `now` on and within `horizon` [s]."""
        speed = 0.0
        n = self.table.piece(now, tick, 0.0)
        while n < self.table.count:
            if self.table.since_start(n, now, tick, horizon) <= 0.0:
                break
            if self.table.since_end(n, now, tick, 0.0) < 0.0:
                speed = ti.max(speed, self.top_speed[n])
            n += 1
        return speed


@ti.data_oriented
class Keeper:
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
        self.values = ti.field(float, self.shape)
        store(self.values, grid.values)

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
        lower, upper = arms.positions.min(axis=0) - 2.0 * support, arms.positions.max(axis=0) + 2.0 * support
        super().__init__(arms, fluid, Geometry(lower.tolist(), upper.tolist(), support), backend)
        self.grid = grid
        self.domain = grid.geometry
        dim, blocks = self.domain.dim, self.domain.blocks
        self.pivot, self.velocity = (ti.Vector.field(dim, float, blocks) for _ in range(2))
        self.turn = ti.Matrix.field(dim, dim, float, blocks)
        self.spin = ti.Vector.field(1 if dim == 2 else 3, float, blocks)
        self.path = Path(body)

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
