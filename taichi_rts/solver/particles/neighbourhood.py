"""What neighbours read of a particle in one step."""

from collections.abc import Set
from typing import Any

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.fields import Declared, Part, reals, vectors
from taichi_rts.solver.particles.fields import components


@ti.data_oriented
class Neighbourhood(Part):
    """What pair loops read, in the grid's order: predicted position x and velocity v, density rho, p/rho^2 [m^5/(kg s^2)].

    With a periodic `geometry` positions are those of any image. With `needs` "acceleration" also a [m/s^2] of the step that
    leads here and the time `elapsed` [s] in it, and with "viscosity" nu [m^2/s].

    Only entries near a due particle are filled in a step. `padding` entries behind the last may be read by loops of
    constant length; they count for nothing.
    """

    transient = frozenset({"x", "v", "rho", "p_over_rho2", "a", "elapsed", "viscosity", "geometry"})

    def __init__(
        self, count: int, dim: int, backend: Backend, needs: Set[str] = frozenset(), geometry: Any = None
    ) -> None:
        self.count = count
        self.geometry = geometry
        self.repeats = geometry is not None and geometry.repeats
        self.has_acceleration = "acceleration" in needs
        self.has_viscosity = "viscosity" in needs
        self.make_fields(self.fields(count, dim, backend.lanes, needs), backend.dtype)
        self.rho.fill(1.0)

    @staticmethod
    def fields(count: int, dim: int, padding: int, needs: Set[str]) -> list[Declared]:
        """Declare the fields for `count` particles and `padding` entries more."""
        padded = count + padding
        declared = [*vectors(dim, padded, "x", "v"), *reals(padded, "rho", "p_over_rho2")]
        if "acceleration" in needs:
            declared += [*vectors(dim, padded, "a"), *reals(padded, "elapsed")]
        if "viscosity" in needs:
            declared += reals(padded, "viscosity")
        return declared

    @property
    def spare(self) -> list[ti.Field]:
        """Fields that may be written to between steps, (capacity,) or more; a density of 0 would do harm."""
        return [*components(self.x), *components(self.v), self.p_over_rho2]

    @ti.func
    def difference(self, i, j):
        """x_i - x_j [m] of two entries, along periodic axes to the nearest of the images of j."""
        x_ij = self.x[i] - self.x[j]
        if ti.static(self.repeats):
            x_ij = self.geometry.difference(self.x[i], self.x[j])
        return x_ij
