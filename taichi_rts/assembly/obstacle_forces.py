"""Forces and torques of the fluid on obstacles, computed only when asked for."""

from typing import Any, NamedTuple

import numpy as np

from taichi_rts.assembly.run import Run
from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.ownership import Start, guarded
from taichi_rts.errors import Error
from taichi_rts.sampling.walls import WallLayer
from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.scene.geometry.periodic import nearest_image, periods
from taichi_rts.scene.obstacles.making import make_solid
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.sums import make_wall_sum
from taichi_rts.solver.motion.motion import Motion
from taichi_rts.solver.physics.obstacles import MovingBody
from taichi_rts.solver.physics.walls import Walls


class ObstacleForces(NamedTuple):
    """Forces [N], (n, dim), and torques [N m] on n obstacles, (n,) in two dimensions (per metre of depth), else (n, 3).

    Torques are about `pivots` [m], (n, dim): of moving obstacles the pivot, of others the middle of the bounding box.
    """

    forces: np.ndarray
    torques: np.ndarray
    pivots: np.ndarray


@ti.data_oriented
class ForceMeter:
    """Sums the forces of each obstacle's wall particles on the fluid, with the opposite sign (Newton's third law).

    The pair forces are those of the momentum equation: pressure and viscosity. Obstacles at rest, whose particles are part of
    the walls at rest in a step, get `Walls` of their own here.
    """

    def __init__(
        self, scene: Scene, motion: Motion, layers: tuple[WallLayer, ...], walls: list[Any], backend: Backend
    ) -> None:
        self.scene = scene
        self.motion = motion
        self.dtype = backend.numpy_dtype
        momentum, grid = motion.momentum, motion.grid
        self.moving = {body.number: body for body in bodies(scene)}
        self.turning = [wall for wall in walls if isinstance(wall, MovingBody)]
        waiting = iter(self.turning)
        own = [
            next(waiting) if k in self.moving else Walls(layer, motion.near, grid.geometry, backend)
            for k, layer in enumerate(layers)
        ]
        self.sums = [make_wall_sum([wall], grid, momentum.wall_pair, momentum.width, backend) for wall in own]
        self.everywhere = ti.field(ti.i32, grid.geometry.blocks)  # all blocks are read at the present tick

    def measure(self, mass: float, now: int, tick: float) -> ObstacleForces:
        """Return forces and torques at tick `now` on obstacles, of particles of `mass` [kg], in a fixed order and in f64."""
        particles, dim = self.motion.particles, self.scene.dim
        self.motion.predict_neighbourhood(self.everywhere, now, tick)
        self.observe(now, tick)
        rates = np.zeros(
            (len(self.sums), particles.born, dim), self.dtype
        )  # zeros of particles that have left add nothing
        places = np.zeros((particles.born, dim), self.dtype)
        self.collect(rates, places)
        push = -mass * rates.astype(np.float64)
        pivots = np.array([self.pivot(k, now * tick) for k in range(len(self.sums))])
        arms = nearest_image(places.astype(np.float64)[None] - pivots[:, None], periods(self.scene))
        if dim == 2:
            torques = (arms[..., 0] * push[..., 1] - arms[..., 1] * push[..., 0]).sum(axis=1)
        else:
            torques = np.cross(arms, push).sum(axis=1)
        return ObstacleForces(push.sum(axis=1), torques, pivots)

    def pivot(self, number: int, time: float) -> np.ndarray:
        """Point [m], (dim,), that the torque on an obstacle is about."""
        if number in self.moving:
            body = self.moving[number]
            return body.pivot + body.pieces.pose(time)[0]
        return make_solid(self.scene.obstacles[number], self.scene.spacing).middle

    @ti.kernel
    def observe(self, now: ti.i32, tick: float):
        for k in range(self.motion.particles.alive[None]):
            for wall in ti.static(self.turning):
                wall.observe(k, now, tick)

    @ti.kernel
    def collect(self, rates: ti.types.ndarray(), places: ti.types.ndarray()):
        for k in range(self.motion.particles.alive[None]):
            i = self.motion.particles.identity[self.motion.grid.order[k]]
            for d in ti.static(range(self.motion.particles.dim)):
                places[i, d] = self.motion.near.x[k][d]
            for w in ti.static(range(len(self.sums))):
                total = self.sums[w](k)
                for d in ti.static(range(self.motion.particles.dim)):
                    rates[w, i, d] = total[d]


@guarded()
class Measured(Run):
    """What `Simulation` measures of its obstacles."""

    obstacle_layers: tuple[WallLayer, ...]
    taichi_start: Start
    _meter: ForceMeter | None = None

    def obstacle_forces(self) -> ObstacleForces:
        """Forces [N] and torques [N m] of the fluid on each obstacle, in the scene's order, at the last step up to `time`.

        The first call compiles; asking changes nothing in the run. Raises `Error` for a scene without obstacles.
        """
        if not self.scene.obstacles:
            raise Error(f"scene {self.scene.name!r} has 0 obstacles, so no force acts on one; give it at least 1")
        if self._meter is None:
            self.taichi_start.require_thread()
            self._meter = ForceMeter(self.local, self.motion, self.obstacle_layers, self.walls, self.backend)
        found = self._meter.measure(self.medium.mass, self.timeline.now, self.timeline.tick)
        return found._replace(pivots=found.pivots + np.asarray(self.origin))
