"""What limits the step of a block: the largest speed, acceleration, viscosity and density of its particles and walls nearby."""

import math

from taichi_rts.device.backend import ti
from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.scene.parts.conditions import face_axis, face_position
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.geometry import MARGIN
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.physics.path import Path


@ti.data_oriented
class BlockMaxima:
    """Reduces a block's particles to what the criteria ask for (Algorithm 1, lines 6-7)."""

    def __init__(self, scene: Scene, particles: FluidState, grid: BlockGrid) -> None:
        self.particles = particles
        self.grid = grid
        self.geometry = grid.geometry
        self.viscosity = max(scene.viscosities)
        self.rest_density = scene.rest_density
        self.walls = [
            (face_axis(wall.face), face + min(wall.displacements), face + max(wall.displacements), wall.top_speed)
            for wall in scene.moving_walls
            for face in [face_position(wall.face, scene.domain)]
        ]
        """Axis, range of places [m] and largest speed [m/s] of each moving face."""
        self.paths = [Path(body) for body in bodies(scene)]
        self.moving = bool(self.walls or self.paths)
        """Whether limits change although no particle does."""
        self.horizon = scene.support / scene.least_wave_speed  # [s]: more than any step
        self.margin = 0.5 * math.hypot(*self.geometry.sides) + max(self.geometry.sides)
        """Half a block's diagonal and a block [m]: how far the middle of one may be from a body that its fluid meets."""

    @ti.func
    def of(self, block, now, tick):
        """Squares of the largest speed [m/s] and acceleration [m/s^2], and the largest viscosity [m^2/s], at tick `now`.

        And the largest density of all last evaluations, over the rest density.
        A face that moves counts with its largest speed in all blocks that it or the fluid beside it may reach: fluid at rest
        must not be stepped over by a wall that starts to move.
        """
        speed2, acceleration2, viscosity, density = 0.0, 0.0, 0.0, 0.0
        for k in range(self.grid.first(block), self.grid.first(block + 1)):
            i = self.grid.order[k]
            a = self.particles.a[i]
            v = self.particles.v[i] + a * (ti.cast(now - self.particles.updated[i], float) * tick)
            speed2 = ti.max(speed2, v.norm_sqr())
            acceleration2 = ti.max(acceleration2, a.norm_sqr())
            density = ti.max(density, self.particles.rho[i])
            if ti.static(self.particles.has_viscosity):
                viscosity = ti.max(viscosity, self.particles.viscosity[i])
        if ti.static(not self.particles.has_viscosity):
            viscosity = self.viscosity
        speed2 = ti.max(speed2, self.wall_speed2(block, now, tick))
        return speed2, acceleration2, viscosity, density / self.rest_density

    @ti.func
    def wall_speed2(self, block, now, tick):
        """Square of the largest speed [m^2/s^2] of the moving faces and obstacles that the block may meet from tick `now` on."""
        speed2 = 0.0
        for wall in ti.static(self.walls):
            low = self.lower(block, wall[0])
            if wall[1] < low + ti.static(2.0 * self.geometry.sides[wall[0]]):
                if low - ti.static(self.geometry.sides[wall[0]]) < wall[2]:
                    speed2 = ti.max(speed2, wall[3] * wall[3])
        for path in ti.static(self.paths):
            speed = path.speed_until(now, tick, self.horizon)
            pivot, _turn = path.pose(now, tick, 0.0)
            middle = ti.zero(pivot)
            for d in ti.static(range(self.geometry.dim)):
                middle[d] = self.lower(block, d) + 0.5 * self.geometry.sides[d]
            reach = path.radius + speed * self.horizon + self.margin
            if self.geometry.difference(middle, pivot).norm_sqr() < reach * reach:
                speed2 = ti.max(speed2, speed * speed)
        return speed2

    @ti.func
    def lower(self, block, axis: ti.template()):
        """Lower coordinate [m] of `block` along `axis`."""
        return self.geometry.lower[axis] + (self.geometry.step(block, axis) - MARGIN) * self.geometry.sides[axis]
