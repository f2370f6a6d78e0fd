"""The state of the fluid: what persists (`FluidState`) and what neighbours read in one step (`Neighbourhood`).

A particle's state is anchored at its own last force evaluation: position, velocity and acceleration at the tick
`updated`. Between evaluations it moves with that constant acceleration, which composes exactly: its state at any later
tick follows in one go, and a particle that is not read need not be touched.
"""

from collections.abc import Set
from typing import Any

import numpy as np

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.fields import Declared, Part, integers, reals, vectors
from taichi_rts.solver.particles.fields import Rows, Values, batches, components


@ti.data_oriented
class FluidState(Part):
    """Struct-of-arrays fields, (capacity,) each; positions x [m], velocities v [m/s], accelerations a [m/s^2], density rho.

    The first `alive[None]` entries hold particles; only an inflow leaves room for more. `born` ids have been given so far,
    and an outlet's are not given again. `updated` is the tick of the last force evaluation, `level` the step in base steps (0
    before the first evaluation), `identity` the stable particle id. Fields are re-sorted now and then so that neighbours in
    space lie close in memory.

    Some fields exist only where something needs them (`needs`, a set of these names):
        rho_rate: d rho/dt [kg/(m^3 s)], where a density is carried through a step or integrated.
        diffusion: the share of it that is numerical diffusion, where it is integrated.
        past: the state at the evaluation before the last (`past_x`, `past_v`, `past_rho`, `past_updated`), where a stepper lets
            some particles run ahead of others, so that readers may look back.
        viscosity: nu [m^2/s], where fluids differ in it.
        sound: c_i [m/s] and `reference`, the density rho_ref [kg/m^3] at which its pressure is zero, where the sound speed is
            regional.
        guided_until: the tick until which an inflow prescribes the velocity.
        budget: in debug runs, `wall_push`, the velocity [m/s] that walls have given a particle so far, and `a_walls`, their
            share of its acceleration; `work` [J/kg] that moving walls and inflows have done on it, and its `power` [W/kg]; with
            a regional sound speed `sound_work` [J/kg], what its changes have put into the energy of compression.
    """

    transient = frozenset({"reals", "integers", "real_scratch", "integer_scratch"})

    def __init__(
        self,
        positions: np.ndarray,
        velocities: np.ndarray,
        densities: np.ndarray,
        rest_density: float,
        backend: Backend,
        needs: Set[str] = frozenset(),
        capacity: int | None = None,
    ) -> None:
        count, self.dim = positions.shape
        self.capacity = count if capacity is None else capacity
        self.alive = ti.field(ti.i32, ())
        self.alive[None] = self.count = self.born = count
        self.has_rho_rate = "rho_rate" in needs
        self.has_diffusion = "diffusion" in needs
        self.has_past = "past" in needs
        self.has_viscosity = "viscosity" in needs
        self.has_sound = "sound" in needs
        self.has_guide = "guided_until" in needs
        self.has_budget = "budget" in needs
        self.reals: list[ti.Field] = []
        self.integers: list[ti.Field] = []
        declared = self.fields(self.capacity, self.dim, needs)
        self.make_fields(declared, backend.dtype)
        for each in declared:
            field = getattr(self, each.name)
            if each.dtype is float:
                self.reals += components(field) if each.shape else [field]
            else:
                self.integers.append(field)
        self.real_scratch: list[ti.Field] = []
        self.integer_scratch: ti.Field = None
        start = (np.ascontiguousarray(each, backend.numpy_dtype) for each in (positions, velocities, densities))
        self.load(*start, rest_density)

    @staticmethod
    def fields(capacity: int, dim: int, needs: Set[str]) -> list[Declared]:
        """Declare the fields with an entry for each of `capacity` particles."""
        n = capacity
        declared = [*vectors(dim, n, "x", "v", "a"), *reals(n, "rho"), *integers(n, "updated", "level", "identity")]
        optional = {
            "rho_rate": reals(n, "rho_rate"),
            "diffusion": reals(n, "diffusion"),
            "past": [*vectors(dim, n, "past_x", "past_v"), *reals(n, "past_rho"), *integers(n, "past_updated")],
            "viscosity": reals(n, "viscosity"),
            "sound": reals(n, "sound", "reference"),
            "guided_until": integers(n, "guided_until"),
            "budget": [
                *vectors(dim, n, "a_walls", "wall_push"),
                *reals(n, "work", "power"),
                *(vectors(dim, n, "past_wall_push") if "past" in needs else []),
                *(reals(n, "sound_work") if "sound" in needs else []),
            ],
        }
        return declared + [field for need, fields in optional.items() if need in needs for field in fields]

    @ti.kernel
    def load(self, x: Rows, v: Rows, rho: Values, rest_density: float):
        """Begin with these, at rest density where no particle is yet; one kernel compiles quicker than many assignments."""
        for k in self.identity:
            self.identity[k] = k
            self.rho[k] = rest_density
            if ti.static(self.has_sound):
                self.reference[k] = rest_density
            if k < x.shape[0]:
                self.rho[k] = rho[k]
                for d in ti.static(range(self.dim)):
                    self.x[k][d], self.v[k][d] = x[k, d], v[k, d]

    @property
    def numpy_dtype(self) -> Any:
        """NumPy's type of the real numbers."""
        return np.float64 if self.x.dtype == ti.f64 else np.float32

    def to_numpy(self, field: ti.Field) -> np.ndarray:
        """Values of one of the fields in order of particle id, (N,) or (N, dim)."""
        values, identity = field.to_numpy()[: self.count], self.identity.to_numpy()[: self.count]
        ordered = np.empty((self.born, *values.shape[1:]), values.dtype)
        ordered[identity] = values
        return ordered if self.count == self.born else ordered[np.sort(identity)]

    def put(self, field: ti.Field, values: Any, rest: float = 0) -> None:
        """Set a field's first entries, those that hold particles, to `values`, (count, ...), and the others to `rest`."""
        whole = field.to_numpy()
        whole[: self.count], whole[self.count :] = values, rest
        field.from_numpy(whole)

    def ids(self) -> np.ndarray:
        """Ids of the particles that are there, (N,), ascending."""
        return np.sort(self.identity.to_numpy()[: self.count])

    def grow(self, count: int) -> None:
        """Make room for `count` more at the end, whose ids follow."""
        self.count += count
        self.born += count
        self.alive[None] = self.count

    def shrink(self, order: ti.Field, count: int) -> None:
        """Bring all entries, unused ones too, into `order`, (capacity,), and let only the first `count` of them be particles."""
        self.alive[None] = self.capacity
        self.reorder(order)
        self.alive[None] = self.count = count

    def borrow(self, reals: list[ti.Field], integer: ti.Field) -> None:
        """Take fields of others, (capacity,) or more, to put values down while they are reordered; the more, the quicker."""
        self.real_scratch, self.integer_scratch = reals, integer

    def carry(self, integer: ti.Field) -> None:
        """Have another field of integers, (capacity,), reordered along with these."""
        self.integers.append(integer)

    def reorder(self, order: ti.Field) -> None:
        """Move entry `order[k]` of every field to place k, then make `order` the identity. Writes to what was borrowed."""
        self.reorder_fields(order)

    @ti.kernel
    def reorder_fields(self, order: ti.template()):
        for few in ti.static(batches(self.reals, len(self.real_scratch))):
            for k in range(self.alive[None]):
                for n in ti.static(range(len(few))):
                    self.real_scratch[n][k] = few[n][order[k]]
            for k in range(self.alive[None]):
                for n in ti.static(range(len(few))):
                    few[n][k] = self.real_scratch[n][k]
        for field in ti.static(self.integers):
            for k in range(self.alive[None]):
                self.integer_scratch[k] = field[order[k]]
            for k in range(self.alive[None]):
                field[k] = self.integer_scratch[k]
        for k in range(self.alive[None]):
            order[k] = k
