"""Fluid that flows in: layers of particles that enter through patches of the domain's faces, one after the other."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.errors import TimeError
from taichi_rts.sampling.sampling import fill_patch, patch_steps
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.particles.extra import Extra
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.particles.past import Past
from taichi_rts.solver.physics.timetable import LAST


class Patch:
    """One inflow of a scene: where its layers enter and when."""

    def __init__(self, scene: Scene, number: int) -> None:
        self.inflow = inflow = scene.inflows[number]
        self.positions = fill_patch(scene, inflow)
        self.interval = patch_steps(scene, inflow)[inflow.axis] / inflow.normal_speed
        """Time [s] between layers."""
        self.guidance = scene.support / inflow.normal_speed
        """Time [s] for which a layer keeps its velocity."""
        stop = scene.end_time if inflow.stop is None else inflow.stop
        self.layers = max(0, math.ceil((stop - inflow.start) / self.interval - 0.5))
        """How many layers enter in all."""
        self.particles = self.layers * len(self.positions)
        """How many particles enter until the scene's end."""

    def entered(self, time: float) -> int:
        """How many layers have entered by `time` [s]: layer k has when its middle crosses the patch (see `crossing`)."""
        return min(self.layers, max(0, math.floor((time - self.inflow.start) / self.interval + 0.5)))

    def crossing(self, layer: int) -> float:
        """Time [s] at which the middle of a layer crosses the patch: k + 1/2 intervals after the start."""
        return self.inflow.start + (layer + 0.5) * self.interval


@ti.data_oriented
class Guide:
    """Lets particles that have flowed in keep their velocity until the tick `guided_until`."""

    def __init__(self, particles: FluidState) -> None:
        self.particles = particles

    @ti.func
    def leads(self, i, present):
        """Whether the velocity of particle `i` is prescribed at tick `present`."""
        return present < self.particles.guided_until[i]


@ti.data_oriented
class Inflows(Extra):
    """Brings the layers that have crossed their patch into the particles' fields, before the grid is sorted.

    They move straight on from where they crossed; their ids follow those that are there.
    """

    def __init__(
        self, scene: Scene, mass: float, patches: list[Patch], particles: FluidState, past: list[Past]
    ) -> None:
        self.scene = scene
        self.mass = mass
        self.particles = particles
        self.past = past
        self.energy = 0.0
        """Kinetic and potential energy [J] of what has entered, when it did."""
        self.viscosity = scene.kinematic_viscosity
        self.patches = patches
        self.done = [0] * len(self.patches)

    @property
    def entered(self) -> int:
        """How many particles have entered so far."""
        return sum(done * len(patch.positions) for done, patch in zip(self.done, self.patches, strict=True))

    def require_room(self, time: float, slack: float) -> None:
        """Raise `TimeError` if a run to `time` [s] would need particles for which no memory was reserved.

        That of an inflow without a `stop` is, until the scene's end; `slack` [s] later than that is no error.
        """
        end = self.scene.end_time
        endless = [number for number, patch in enumerate(self.patches) if patch.inflow.stop is None]
        if endless and time > end + slack:
            raise TimeError(
                f"time {time:g} s lies after the scene's end_time {end:g} s, until which memory is reserved for what flows in "
                f"through inflows.{endless[0]}; start with scene.replace(end_time={time:g}), or with a stop at which it ends"
            )

    def before_sort(self, now: int, tick: float, before_change: Callable[[], object]) -> None:
        """Let in what has crossed its patch by tick `now`."""
        if self.waiting(now * tick):
            before_change()
            self.enter(now, tick)

    def energy_brought(self) -> float:
        """Kinetic and potential energy [J] of what has entered."""
        return self.energy

    def kept(self, tick: float) -> Any:
        """Layers that have entered, their energy, and the times [s] until which particles are guided, (N,) by id."""
        p = self.particles
        return tuple(self.done), self.energy, p.to_numpy(p.guided_until) * tick

    def go_on(self, kept: Any, now: int, tick: float) -> None:
        """Go on from there."""
        done, self.energy, guided_until = kept
        self.done = list(done)
        until = np.ceil(guided_until / tick * (1.0 - 1e-12))
        self.particles.put(self.particles.guided_until, np.minimum(until, LAST).astype(np.int32))

    def waiting(self, time: float) -> bool:
        """Whether a layer has crossed its patch by `time` [s] and is not among the particles yet."""
        return any(patch.entered(time) > done for patch, done in zip(self.patches, self.done, strict=True))

    def enter(self, now: int, tick: float) -> None:
        """Append the layers that have crossed by tick `now`."""
        particles, time = self.particles, now * tick
        for number, patch in enumerate(self.patches):
            velocity = np.asarray(patch.inflow.velocity)
            for layer in range(self.done[number], patch.entered(time)):
                x = patch.positions + velocity * (time - patch.crossing(layer))
                guided_until = min(math.ceil((patch.crossing(layer) + patch.guidance) / tick), LAST)
                first = particles.count
                particles.grow(len(x))
                dtype = particles.numpy_dtype
                potential = -x @ np.asarray(self.scene.acceleration_at(time)) - self.scene.floor_potential
                self.energy += self.mass * float((0.5 * velocity @ velocity + potential).sum())
                self.append(first, now, guided_until, x.astype(dtype), velocity.astype(dtype))
            self.done[number] = patch.entered(time)

    @ti.kernel
    def append(
        self,
        first: ti.i32,
        now: ti.i32,
        guided_until: ti.i32,
        x: ti.types.ndarray(),
        v: ti.types.ndarray(),
    ):
        p = self.particles
        for n in range(x.shape[0]):
            i = first + n
            for d in ti.static(range(p.dim)):
                p.x[i][d] = x[n, d]
                p.v[i][d] = v[d]
            p.updated[i] = now
            p.guided_until[i] = guided_until
            for past in ti.static(self.past):
                past.begin(i, now)
            if ti.static(p.has_viscosity):
                p.viscosity[i] = self.viscosity
