"""Faces of the domain that move as the scene prescribes: pistons, and lids that slide along themselves."""

import numpy as np

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.fields import Declared, reals
from taichi_rts.sampling.walls import WallLayer
from taichi_rts.scene.parts.conditions import MovingWall, face_axis
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.physics.timetable import Timetable, store
from taichi_rts.solver.physics.walls import Walls


@ti.data_oriented
class MovingFace(Walls):
    """Wall particles that move together, sorted once in their own frame; fluid is brought into that frame at its own time.

    So readers at different times see the wall each at its own, and nothing has to be sorted again. Those of a face that slides
    along itself stay where they are, as it is even: only friction sees how fast it is.
    """

    moves = True

    def __init__(
        self,
        description: MovingWall,
        layer: WallLayer,
        fluid: Neighbourhood,
        geometry: Geometry,
        backend: Backend,
    ) -> None:
        super().__init__(layer, fluid, geometry, backend)
        self.axis = face_axis(description.face)
        self.at_lower = description.face[1] == "-"
        self.face = (geometry.lower if self.at_lower else geometry.upper)[self.axis]
        self.slides = tuple(description.velocity or ())
        times, displacements, velocities = description.times, description.displacements, description.velocities
        self.make_fields(self.place_fields(fluid.count), backend.dtype)
        self.table = Timetable(times, [*np.diff(times), 1e30])  # the last piece is the rest after the end
        self.displacement, self.velocity = (ti.field(backend.dtype, self.table.count) for _ in range(2))
        store(self.displacement, np.array(displacements))
        store(self.velocity, np.array([*velocities, 0.0]))

    @staticmethod
    def place_fields(count: int) -> list[Declared]:
        """Declare the fields with an entry for each of `count` places of fluid particles.

        That is the displacement [m] of the frame at the time of the due particle there, and its rate [m/s].
        """
        return reals(count, "shift", "speed")

    @ti.func
    def motion(self, now, tick):
        """Displacement [m] and velocity [m/s] along the axis at tick `now`."""
        n = self.table.piece(now, tick, 0.0)
        ticks, rest = self.table.lasted(n, now, tick, 0.0)
        moves = ti.cast(self.table.lasts(n, now, tick, 0.0), float)
        return self.displacement[n] + (ti.cast(ticks, float) * tick + rest) * self.velocity[n], moves * self.velocity[n]

    @ti.func
    def observe(self, k, now, tick):
        """Note where the wall is for the due particle at place `k`, which is at tick `now`."""
        self.shift[k], self.speed[k] = self.motion(now, tick)

    @ti.func
    def seen_from(self, k, cell):
        """Position [m] and cell, in the wall's frame, of the due particle at place `k`."""
        x = self.fluid.x[k]
        x[self.axis] -= self.shift[k]
        x = self.geometry.place(x)
        return x, self.geometry.cell(x)

    @ti.func
    def difference(self, k, b):
        """x_k - x_b [m] between the due particle at place `k` and wall particle `b`."""
        x = self.fluid.x[k]
        x[self.axis] -= self.shift[k]
        return self.geometry.difference(x, self.x[b])

    @ti.func
    def relative_velocity(self, k, b):
        """v_k - v_b [m/s]."""
        v = self.fluid.v[k]
        v[self.axis] -= self.speed[k]
        return v

    @ti.func
    def slip(self, k, b, x_ib, v_ib):
        """Velocity [m/s] of the fluid at place `k` past the face, which may slide."""
        v = v_ib
        for d in ti.static(range(len(self.slides))):
            v[d] -= self.slides[d]
        return v

    @ti.func
    def hold(self, x, now, tick):
        """Nearest point to `x` [m] that the face has not passed at tick `now`."""
        displacement, _velocity = self.motion(now, tick)
        y = x
        if ti.static(self.at_lower):
            y[self.axis] = ti.max(x[self.axis], self.face + displacement)
        else:
            y[self.axis] = ti.min(x[self.axis], self.face + displacement)
        return y
