"""Forces of a user's own, which `Simulation(scene, stepper, forces=[...])` takes; docs/extending.md shows both kinds.

A body force is a `ti.func` of a position x [m], (dim,), and a time t [s], which returns an acceleration [m/s^2], (dim,).

A pair force is an object of a class with `@ti.data_oriented` and two ti.funcs. Both return an acceleration [m/s^2], (dim,):

- `fluid_pair(self, near, i, j, x_ij, v_ij, d2)` that of particle i due to particle j. `near.rho[i]` [kg/m^3], `near.v[i]` [m/s],
  and `near.p_over_rho2[i]` may be read, and the same of j;
- `wall_pair(self, i, b, x_ib, v_ib, d2, wall)` that due to wall particle b; `wall.volume[b]` [m^dim] and the normal into the
  fluid, `wall.facing(i, b)`, may be read.

x_ij = x_i - x_j [m] and v_ij = v_i - v_j [m/s] are vectors, d2 = |x_ij|^2 [m^2]. Only pairs with 0 < |x_ij| < r count, r being
the support radius. Momentum is kept if fluid_pair(j, i) = -fluid_pair(i, j), as all particles have the same mass: so any multiple
of x_ij or of v_ij that is the same for both keeps it.
"""

import inspect
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.errors import Error
from taichi_rts.medium.medium import Medium
from taichi_rts.solver.grid.geometry import Geometry

PAIR = {"fluid_pair": ("near", "i", "j", "x_ij", "v_ij", "d2"), "wall_pair": ("i", "b", "x_ib", "v_ib", "d2", "wall")}
BODY = ("x", "t")
SEE = "see docs/extending.md"


@dataclass(frozen=True)
class OwnForces:
    """A user's forces by their kind, and the point [m], (dim,), from which a run counts positions (`scene.placing`)."""

    pairs: tuple[Any, ...] = ()
    bodies: tuple[Any, ...] = ()
    origin: tuple[float, ...] = ()


def own_forces(forces: Sequence[Any], origin: Sequence[float] = ()) -> OwnForces:
    """Sort a user's `forces` by their kind, for a run that counts from `origin`; raises `Error` for what is no force."""
    if not isinstance(forces, (list, tuple)):
        raise Error(f"forces is {forces!r}; give a list of forces, [...]")
    pairs: list[Any] = []
    bodies: list[Any] = []
    for number, force in enumerate(forces):
        (bodies if _is_body(force, f"forces[{number}]") else pairs).append(force)
    return OwnForces(tuple(pairs), tuple(bodies), tuple(origin))


def _is_body(force: Any, place: str) -> bool:
    """Whether `force` is a body force, else a pair force; raises `Error` if it is neither."""
    if isinstance(force, type):
        raise Error(f"{place} is the class {force.__name__}; give an object of it, {force.__name__}(...)")
    if inspect.isroutine(force):
        name = getattr(force, "__qualname__", repr(force))
        if not _is_ti_func(force):
            raise Error(f"{place} is {name}, which is no ti.func; write @ti.func above it ({SEE})")
        _require_arguments(force, BODY, f"{place}, {name}")
        return True
    kind = type(force).__name__
    missing = [name for name in PAIR if not _is_ti_func(getattr(force, name, None))]
    if missing:
        raise Error(
            f"{place} is {kind}, which is neither a ti.func of position and time nor a pair force: it has no ti.func "
            f"{' and no '.join(missing)} ({SEE})"
        )
    if not getattr(type(force), "_data_oriented", False):
        raise Error(f"{place} is of class {kind}, which Taichi cannot compile; write @ti.data_oriented above the class")
    for name, arguments in PAIR.items():
        _require_arguments(getattr(force, name), arguments, f"{place}, {kind}.{name}")
    return False


def _is_ti_func(thing: Any) -> bool:
    return bool(getattr(thing, "_is_taichi_function", False))


def _require_arguments(function: Any, wanted: Sequence[str], what: str) -> None:
    found = list(inspect.signature(function).parameters)
    if len(found) != len(wanted):
        raise Error(f"{what} takes {len(found)} arguments ({', '.join(found)}); it is to take ({', '.join(wanted)})")


def forces_data(forces: Iterable[Any]) -> list[dict[str, Any]]:
    """Return forces as plain data, by which a checkpoint knows them again: the name, and numbers and texts an object has."""
    found = []
    for force in forces:
        body = inspect.isroutine(force)
        data = {"name": force.__qualname__ if body else type(force).__qualname__}
        found.append(data | ({} if body else _plain_values(force)))
    return found


def _plain_values(force: Any) -> dict[str, Any]:
    """What Python and NumPy numbers, texts and arrays `force` has as attributes, as JSON gives them back."""
    found = {}
    for name, value in vars(force).items():
        value = value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
        value = list(value) if isinstance(value, tuple) else value
        each = value if isinstance(value, list) else [value]
        if all(item is None or isinstance(item, (bool, int, float, str, list)) for item in each):
            found[name] = value
    return found


@ti.data_oriented
class OwnPairs:
    """The sum of all own pair forces of a pair, cut off at the support radius."""

    def __init__(self, pairs: Sequence[Any], medium: Medium) -> None:
        self.pairs = list(pairs)
        self.support2 = medium.support**2

    @ti.func
    def fluid_pair(self, near: ti.template(), i, j, x_ij, v_ij, d2):
        """Acceleration [m/s^2] of particle i by particle j; loops offer i itself and what is too far away as well."""
        total = ti.zero(x_ij)
        for force in ti.static(self.pairs):
            total += force.fluid_pair(near, i, j, x_ij, v_ij, d2)
        return self.cut(total, d2)

    @ti.func
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall: ti.template()):
        """Acceleration [m/s^2] of particle i by wall particle b."""
        total = ti.zero(x_ib)
        for force in ti.static(self.pairs):
            total += force.wall_pair(i, b, x_ib, v_ib, d2, wall)
        return self.cut(total, d2)

    @ti.func
    def cut(self, total, d2):
        """The same within the support, else 0; what is no number there does no harm."""
        counts = d2 > 0.0 and d2 < self.support2
        for d in ti.static(range(total.n)):
            total[d] = ti.select(counts, total[d], 0.0)
        return total


@ti.data_oriented
class OwnBodies:
    """The sum of all own body forces. They see positions as the scene counts them, while a run counts from `origin` [m]."""

    def __init__(self, own: OwnForces, geometry: Geometry) -> None:
        self.bodies = list(own.bodies)
        self.origin = list(own.origin)
        self.is_far = any(self.origin)
        self.geometry = geometry

    @ti.func
    def acceleration(self, x, now, tick):
        """Acceleration [m/s^2], (dim,), at position `x` [m] and tick `now`.

        A time in seconds is what a user asks for, so here it is worked out: in single precision it is known to 1e-7 of itself.
        """
        place = x
        if ti.static(self.geometry.repeats):
            place = self.geometry.place(x)
        if ti.static(self.is_far):
            place += ti.Vector(self.origin)
        time = ti.cast(now, float) * tick
        total = ti.zero(x)
        for force in ti.static(self.bodies):
            total += force(place, time)
        return total
