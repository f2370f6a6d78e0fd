"""Wall particles of moving obstacles, which move and turn with them."""

from dataclasses import replace

import numpy as np

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.fields import Declared
from taichi_rts.sampling.walls import WallLayer
from taichi_rts.scene.geometry.bodies import Body
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.physics.path import Path
from taichi_rts.solver.physics.walls import Walls


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
        if any(body.spans):  # and goes on from one end of the domain to the other
            periods = np.array(body.periods)
            lower, upper = np.where(body.spans, [-0.5 * periods, 0.5 * periods], [around.lower, around.upper])
            around = Geometry(lower.tolist(), upper.tolist(), support, 0.0, body.spans)
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
        x_kb = self.domain.difference(self.fluid.x[k], self.pivot[n]) - self.turn[n] @ self.x[b]
        if ti.static(self.geometry.repeats):  # it does not turn
            x_kb = self.geometry.difference(x_kb, ti.zero(x_kb))
        return x_kb

    @ti.func
    def relative_velocity(self, k, b):
        """v_k - v_b [m/s]."""
        n = self.block(k)
        return self.fluid.v[k] - self.velocity[n] - self.path.carried(self.spin[n], self.turn[n] @ self.x[b])

    @ti.func
    def slip(self, k, b, x_ib, v_ib):
        """Velocity [m/s] of the fluid at place `k` past the face, where the line to particle `b` crosses it.

        There a turning body is as fast as fluid that rests on it. Its particles lie deeper, and so have another speed: those of
        a cup are faster than its inside.
        """
        share = 1.0 - 1.0 / (self.shear(k, b, x_ib) * self.stiffness)  # of the way from b to k that lies in the body
        return v_ib - share * self.path.carried(self.spin[self.block(k)], x_ib)

    @ti.func
    def facing(self, k, b):
        """Normal of wall particle `b`, as the world sees it at the time of the particle at place `k`."""
        return self.turn[self.block(k)] @ self.normal[b]
