"""Fluid that flows in: layers of particles that enter through patches of the domain's faces, one after the other."""

import math

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.sampling.sampling import fill_patch
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.particles.particles import Particles
from taichi_rts.solver.physics.timetable import LAST


class Patch:
    """One inflow of a scene: where its layers enter and when."""

    def __init__(self, scene: Scene, number: int) -> None:
        self.inflow = inflow = scene.inflows[number]
        self.positions = fill_patch(scene, inflow)
        self.interval = scene.spacing / inflow.normal_speed
        """Time [s] between layers."""
        self.guidance = scene.support / inflow.normal_speed
        """Time [s] for which a layer keeps its velocity."""
        stop = scene.end_time if inflow.stop is None else inflow.stop
        self.layers = max(0, math.ceil((stop - inflow.start) / self.interval - 0.5))
        """How many layers enter in all."""

    def entered(self, time: float) -> int:
        """How many layers have entered by `time` [s]: layer k has when its middle crosses the patch (see `crossing`)."""
        return min(self.layers, max(0, math.floor((time - self.inflow.start) / self.interval + 0.5)))

    def crossing(self, layer: int) -> float:
        """Time [s] at which the middle of a layer crosses the patch: k + 1/2 intervals after the start."""
        return self.inflow.start + (layer + 0.5) * self.interval


@ti.data_oriented
class Inflows:
    """Brings the layers that have crossed their patch into the particles' fields, before the grid is sorted.

    They move straight on from where they crossed; their ids follow those that are there.
    """

    def __init__(self, scene: Scene, mass: float) -> None:
        self.scene = scene
        self.mass = mass
        self.energy = 0.0
        """Kinetic and potential energy [J] of what has entered, when it did."""
        self.viscosity = scene.kinematic_viscosity
        self.patches = [Patch(scene, number) for number in range(len(scene.inflows))]
        self.done = [0] * len(self.patches)
        self.capacity = sum(patch.layers * len(patch.positions) for patch in self.patches)
        """Number of particles that enter until the scene's end."""

    @property
    def entered(self) -> int:
        """How many particles have entered so far."""
        return sum(done * len(patch.positions) for done, patch in zip(self.done, self.patches, strict=True))

    def waiting(self, time: float) -> bool:
        """Whether a layer has crossed its patch by `time` [s] and is not among the particles yet."""
        return any(patch.entered(time) > done for patch, done in zip(self.patches, self.done, strict=True))

    def enter(self, particles: Particles, now: int, tick: float) -> None:
        """Append the layers that have crossed by tick `now`."""
        time = now * tick
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
                self.append(particles, first, now, guided_until, x.astype(dtype), velocity.astype(dtype))
            self.done[number] = patch.entered(time)

    @ti.kernel
    def append(
        self,
        particles: ti.template(),
        first: ti.i32,
        now: ti.i32,
        guided_until: ti.i32,
        x: ti.types.ndarray(),
        v: ti.types.ndarray(),
    ):
        for n in range(x.shape[0]):
            i = first + n
            for d in ti.static(range(particles.dim)):
                particles.x[i][d] = x[n, d]
                particles.v[i][d] = v[d]
            particles.updated[i] = now
            particles.guided_until[i] = guided_until
            if ti.static(particles.has_past):
                particles.past_x[i], particles.past_v[i] = particles.x[i], particles.v[i]
                particles.past_rho[i], particles.past_updated[i] = particles.rho[i], now
            if ti.static(particles.has_viscosity):
                particles.viscosity[i] = self.viscosity
