"""Fluid that flows out: particles in an outlet's box are removed from the particles' fields."""

from collections.abc import Callable
from typing import Any

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.device.fields import Declared, Part, integers, within
from taichi_rts.device.scan import ExclusiveScan
from taichi_rts.medium.energy import potential_of
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.motion.motion import Motion
from taichi_rts.solver.particles.extra import Extra

EVERY = 4  # sorts between two checks, each of which the host waits for: fluid at Mach 0.1 moves 0.16 r meanwhile


@ti.data_oriented
class Outlets(Part, Extra):
    """Takes out the particles that are in an outlet, before the grid is sorted; their ids are not given again.

    Those that stay keep their order in memory, and what an inflow has yet to bring follows them: entries of particles that are
    gone lie behind that and are not used again, because there is room for all that ever enters.
    """

    transient = frozenset({"stays", "place"})

    def __init__(self, scene: Scene, motion: Motion, mass: float) -> None:
        self.scene = scene
        self.mass = mass
        self.outlets = scene.outlets
        self.motion = motion
        self.particles = motion.particles
        self.grid = motion.grid
        self.removed = [0] * len(scene.outlets)
        """How many particles each outlet has taken out."""
        self.energy = 0.0
        """Kinetic, potential and internal energy [J] of what has been taken out, when it was."""
        self.work = 0.0
        """Work [J] that moving walls and inflows had done on it."""
        self.looks = 0
        self.make_fields(self.fields(self.particles.capacity))
        self.scan = ExclusiveScan(self.stays, self.place)
        self.found = ti.field(ti.i32, ())

    @staticmethod
    def fields(capacity: int) -> list[Declared]:
        """Declare the fields for `capacity` particles."""
        own = [*integers(capacity, "stays"), *integers(capacity + 1, "place")]
        return own + within("scan", ExclusiveScan.fields(capacity))

    def before_sort(self, now: int, tick: float, before_change: Callable[[], object]) -> None:
        """Take out what is in an outlet at tick `now`."""
        if leaving := self.find(now, tick):
            before_change()
            self.take_out(leaving, now, tick)

    def statistics(self) -> dict[str, Any]:
        """How many particles each outlet has taken out."""
        return {"removed_by_outlets": list(self.removed)}

    def energy_brought(self) -> float:
        """The energy [J] taken out, less than nothing, and the work that had been done on it, which went out with it."""
        return self.work - self.energy

    def kept(self, tick: float) -> Any:
        """How many particles each outlet has taken out, their energy and the work done on them."""
        return tuple(self.removed), self.energy, self.work

    def go_on(self, kept: Any, now: int, tick: float) -> None:
        """Go on from there."""
        removed, self.energy, self.work = kept
        self.removed, self.looks = list(removed), 0

    def find(self, now: int, tick: float) -> int:
        """Return how many particles are in an outlet at tick `now`; only every `EVERY`-th call looks, others return 0."""
        self.looks += 1
        if (self.looks - 1) % EVERY:
            return 0
        self.mark(now, tick)
        return int(self.found[None])

    def take_out(self, count: int, now: int, tick: float) -> None:
        """Take out the `count` particles that `find` has found."""
        particles, dim = self.particles, self.particles.dim
        dtype = particles.numpy_dtype
        states = np.zeros((count, dim + 3), dtype)  # outlet, position [m], energies without potential and work [J/kg]
        self.scan.run()
        self.line_up(particles.count - count, states, now, tick)
        particles.shrink(self.grid.order, particles.count - count)
        self.grid.forget()
        for number in range(len(self.removed)):
            self.removed[number] += int((states[:, 0] == number).sum())
        total = states.astype(np.float64)
        potential = potential_of(self.scene, total[:, 1 : dim + 1], now * tick)
        self.energy += self.mass * float((potential + total[:, dim + 1]).sum())
        self.work += self.mass * float(total[:, dim + 2].sum())

    @ti.func
    def outlet_of(self, x):
        """Number of the outlet that position `x` [m] lies in, -1 for none."""
        number = -1
        for k in ti.static(range(len(self.outlets))):
            inside = True
            for d in ti.static(range(self.particles.dim)):
                low, high = ti.static(self.outlets[k].lower[d], self.outlets[k].upper[d])
                inside = inside and low <= x[d] and x[d] <= high
            if inside:
                number = k
        return number

    @ti.kernel
    def mark(self, now: ti.i32, tick: float):
        self.found[None] = 0
        for i in self.stays:
            self.stays[i] = 0
            if i < self.particles.alive[None]:
                x = self.motion.position(i, self.motion.elapsed(i, now, tick), tick)
                if self.outlet_of(x) < 0:
                    self.stays[i] = 1
                else:
                    self.found[None] += 1

    @ti.kernel
    def line_up(self, left: ti.i32, states: ti.types.ndarray(), now: ti.i32, tick: float):
        """Put those that stay first in the grid's order, then the entries not used yet, then those that leave."""
        for i in self.stays:
            alive = self.particles.alive[None]
            if i >= alive:
                self.grid.order[left + i - alive] = i
            elif self.stays[i] == 1:
                self.grid.order[self.place[i]] = i
            else:
                n = i - self.place[i]
                self.grid.order[left + self.particles.capacity - alive + n] = i
                dt = self.motion.elapsed(i, now, tick)
                x, v = self.motion.position(i, dt, tick), self.motion.velocity(i, dt, tick)
                compression = self.motion.equation_of_state.energy_of(i, self.motion.density(i, dt, tick))
                states[n, 0] = ti.cast(self.outlet_of(x), float)
                for d in ti.static(range(self.particles.dim)):
                    states[n, 1 + d] = x[d]
                states[n, 1 + self.particles.dim] = 0.5 * v.norm_sqr() + compression
                if ti.static(self.particles.has_budget):
                    states[n, 2 + self.particles.dim] = self.particles.work[i] + self.particles.power[i] * dt
