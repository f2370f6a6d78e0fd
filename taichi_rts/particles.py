"""The state of the fluid: what persists (`Particles`) and what neighbours read in one step (`Neighbourhood`).

A particle's state is anchored at its own last force evaluation: position, velocity and acceleration at the tick
`updated`. Between evaluations it moves with that constant acceleration, which composes exactly: its state at any later
tick follows in one go, and a particle nobody asks for need not be touched.
"""

from typing import Any

import numpy as np
import taichi as ti

from taichi_rts.backend import Backend


def vector_field(dim: int, dtype: Any, count: int) -> ti.MatrixField:
    """A field of `count` vectors as a struct of arrays: one contiguous array a component."""
    return ti.Vector.field(dim, dtype, count, layout=ti.Layout.SOA)


@ti.data_oriented
class Particles:
    """Struct-of-arrays fields, (N,) each; positions x [m], velocities v [m/s], accelerations a [m/s^2], density rho.

    `rho_rate` d rho/dt [kg/(m^3 s)] exists only where a stepper extrapolates densities.
    `updated` is the tick of the last force evaluation, `level` the step in base steps (0 before the first evaluation),
    `identity` the stable particle id. The `past_` fields are the state at the evaluation before; they exist only where a
    stepper lets some particles run ahead of others, so that readers may look back. In debug runs `wall_push` is the velocity
    [m/s] that walls have given a particle so far, `a_walls` their share of its acceleration. Fields are re-sorted now and then
    so that neighbours in space lie close in memory.
    """

    def __init__(
        self,
        positions: np.ndarray,
        velocities: np.ndarray,
        rest_density: float,
        backend: Backend,
        *,
        with_rho_rate: bool = False,
        with_past: bool = False,
        with_budget: bool = False,
    ) -> None:
        self.count, self.dim = positions.shape
        self.x = vector_field(self.dim, backend.dtype, self.count)
        self.v = vector_field(self.dim, backend.dtype, self.count)
        self.a = vector_field(self.dim, backend.dtype, self.count)
        self.rho = ti.field(backend.dtype, self.count)
        self.has_rho_rate = with_rho_rate
        self.rho_rate: Any = ti.field(backend.dtype, self.count) if with_rho_rate else None
        self.updated = ti.field(ti.i32, self.count)
        self.level = ti.field(ti.i32, self.count)
        self.identity = ti.field(ti.i32, self.count)
        self.has_past = with_past
        if with_past:
            self.past_x = vector_field(self.dim, backend.dtype, self.count)
            self.past_v = vector_field(self.dim, backend.dtype, self.count)
            self.past_rho = ti.field(backend.dtype, self.count)
            self.past_updated = ti.field(ti.i32, self.count)
        self.has_budget = with_budget
        if with_budget:
            self.a_walls = vector_field(self.dim, backend.dtype, self.count)
            self.wall_push = vector_field(self.dim, backend.dtype, self.count)
            if with_past:
                self.past_wall_push = vector_field(self.dim, backend.dtype, self.count)
        self.real_scratch = ti.field(backend.dtype, self.count)
        self.integer_scratch = ti.field(ti.i32, self.count)
        self.x.from_numpy(positions.astype(backend.numpy_dtype))
        self.v.from_numpy(velocities.astype(backend.numpy_dtype))
        self.rho.fill(rest_density)
        self.identity.from_numpy(np.arange(self.count, dtype=np.int32))

    def reorder(self, order: ti.Field) -> None:
        """Move entry `order[k]` of every field to place k, then make `order` the identity."""
        self.reorder_fields(order)

    @ti.kernel
    def reorder_fields(self, order: ti.template()):
        for field in ti.static(self._real_fields()):
            for k in range(self.count):
                self.real_scratch[k] = field[order[k]]
            for k in range(self.count):
                field[k] = self.real_scratch[k]
        for field in ti.static(self._integer_fields()):
            for k in range(self.count):
                self.integer_scratch[k] = field[order[k]]
            for k in range(self.count):
                field[k] = self.integer_scratch[k]
        for k in range(self.count):
            order[k] = k

    def _real_fields(self) -> list[ti.Field]:
        vectors = [self.x, self.v, self.a] + ([self.past_x, self.past_v] if self.has_past else [])
        vectors += [self.a_walls, self.wall_push] if self.has_budget else []
        vectors += [self.past_wall_push] if self.has_budget and self.has_past else []
        scalars = (
            [self.rho] + ([self.past_rho] if self.has_past else []) + ([self.rho_rate] if self.has_rho_rate else [])
        )
        return [field.get_scalar_field(d) for field in vectors for d in range(self.dim)] + scalars

    def _integer_fields(self) -> list[ti.Field]:
        return [self.updated, self.level, self.identity] + ([self.past_updated] if self.has_past else [])


@ti.data_oriented
class Neighbourhood:
    """What pair loops read, in the grid's order: predicted position x and velocity v, density rho, p/rho^2 [m^5/(kg s^2)].

    Only entries near a due particle are filled in a step. `padding` entries behind the last may be read by loops of
    constant length; they count for nothing.
    """

    def __init__(self, count: int, dim: int, backend: Backend) -> None:
        padded = count + backend.lanes
        self.x = vector_field(dim, backend.dtype, padded)
        self.v = vector_field(dim, backend.dtype, padded)
        self.rho = ti.field(backend.dtype, padded)
        self.p_over_rho2 = ti.field(backend.dtype, padded)
        self.rho.fill(1.0)
