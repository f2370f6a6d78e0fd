"""Where a moving body is, as a function of time, on the device."""

import math

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.scene.geometry.bodies import Body
from taichi_rts.solver.physics.timetable import Timetable, Wheel, store


@ti.data_oriented
class Path:
    """Where a moving body is, as a function of time alone: for any time, `ahead` [s] after tick `now`."""

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
        """Direction of the angular velocity; in two dimensions `wheel` has the sign."""
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
