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
from taichi_rts.solver.grid.sums import make_neighbour_sum, make_wall_sum
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

    The pair forces are those of the momentum equation: pressure and viscosity. For obstacles at rest, whose particles are part
    of the walls at rest in a step, they are summed over the fluid near each wall particle, with the same code for any number of
    obstacles; for each moving one over its wall particles near each fluid particle.
    """

    def __init__(
        self, scene: Scene, motion: Motion, layers: tuple[WallLayer, ...], walls: list[Any], backend: Backend
    ) -> None:
        self.periods = periods(scene)
        self.motion = motion
        self.dtype = backend.numpy_dtype
        momentum, grid = motion.momentum, motion.grid
        self.dim = scene.dim
        self.moving = bodies(scene)
        self.turning = [wall for wall in walls if isinstance(wall, MovingBody)]
        self.sums = [make_wall_sum([wall], grid, momentum.wall_pair, momentum.width, backend) for wall in self.turning]
        self.everywhere = ti.field(ti.i32, grid.geometry.blocks)  # all blocks are read at the present tick
        self.middles = np.array([make_solid(obstacle, scene.spacing).middle for obstacle in scene.obstacles])
        moving = {body.number for body in self.moving}
        resting = [k for k in range(len(layers)) if k not in moving and len(layers[k].positions)]
        self.has_resting = bool(resting)
        if resting:
            layer = layers[resting[0]].joined([layers[k] for k in resting[1:]])
            owners = np.repeat(resting, [len(layers[k].positions) for k in resting])
            order = np.argsort(grid.geometry.cell_numpy(layer.positions), kind="stable")  # as `Walls` sorts them
            self.owners, self.places = owners[order], layer.positions[order]
            self.wall = Walls(layer, motion.near, grid.geometry, backend)
            pair = self.make_pair(momentum.wall_pair(self.wall), backend.dtype)
            self.sum = make_neighbour_sum(grid.geometry, grid.start, pair, self.width, backend, lanes=1)

    @property
    def width(self) -> int:
        """Number of components of a force and a torque."""
        return self.dim + (1 if self.dim == 2 else 3)

    def make_pair(self, wall_pair: Any, dtype: Any) -> Any:
        """Return the ti.func `pair(b, j)`: acceleration of the fluid at place j by wall particle b, and its moment about b."""
        dim, width, wall = self.dim, self.width, self.wall

        @ti.func
        def pair(b, j):
            rates, arm = wall_pair(j, b), wall.difference(j, b)
            total = ti.Vector.zero(dtype, width)
            for d in ti.static(range(dim)):
                total[d] = rates[d]
            if ti.static(dim == 2):
                total[2] = arm[0] * rates[1] - arm[1] * rates[0]
            else:
                for d in ti.static(range(3)):
                    e, f = ti.static((d + 1) % 3, (d + 2) % 3)
                    total[3 + d] = arm[e] * rates[f] - arm[f] * rates[e]
            return total

        return pair

    def measure(self, mass: float, now: int, tick: float) -> ObstacleForces:
        """Return forces and torques at tick `now` on obstacles, of particles of `mass` [kg], in a fixed order and in f64."""
        dim, count = self.dim, len(self.middles)
        self.motion.predict_neighbourhood(self.everywhere, now, tick)
        forces, torques, pivots = np.zeros((count, dim)), np.zeros((count, self.width - dim)), self.middles.copy()
        if self.turning:
            numbers = [body.number for body in self.moving]
            pivots[numbers] = [body.pivot + body.pieces.pose(now * tick)[0] for body in self.moving]
            forces[numbers], torques[numbers] = self.on_moving(mass, pivots[numbers], now, tick)
        if self.has_resting:
            found = np.zeros((len(self.owners), self.width), self.dtype)
            self.collect_resting(found)
            push = -mass * found.astype(np.float64)
            arms = nearest_image(self.places - pivots[self.owners], self.periods)
            push[:, dim:] += moments(arms, push[:, :dim])
            total = np.stack([np.bincount(self.owners, column, minlength=count) for column in push.T], axis=1)
            forces += total[:, :dim]
            torques += total[:, dim:]
        return ObstacleForces(forces, torques[:, 0] if dim == 2 else torques, pivots)

    def on_moving(self, mass: float, pivots: np.ndarray, now: int, tick: float) -> tuple[np.ndarray, np.ndarray]:
        """Forces [N] and torques [N m] about `pivots` [m] on moving obstacles, (n, dim) and (n, 1 or 3)."""
        self.observe(now, tick)
        born = self.motion.particles.born
        rates = np.zeros((len(self.sums), born, self.dim), self.dtype)  # zeros of particles that have left add nothing
        places = np.zeros((born, self.dim), self.dtype)
        self.collect(rates, places)
        push = -mass * rates.astype(np.float64)
        arms = nearest_image(places.astype(np.float64)[None] - pivots[:, None], self.periods)
        return push.sum(axis=1), moments(arms, push).sum(axis=1)

    @ti.kernel
    def observe(self, now: ti.i32, tick: float):
        for k in range(self.motion.particles.alive[None]):
            for wall in ti.static(self.turning):
                wall.observe(k, now, tick)

    @ti.kernel
    def collect(self, rates: ti.types.ndarray(), places: ti.types.ndarray()):
        for k in range(self.motion.particles.alive[None]):
            i = self.motion.particles.identity[self.motion.grid.order[k]]
            for d in ti.static(range(self.dim)):
                places[i, d] = self.motion.near.x[k][d]
            for w in ti.static(range(len(self.sums))):
                total = self.sums[w](k)
                for d in ti.static(range(self.dim)):
                    rates[w, i, d] = total[d]

    @ti.kernel
    def collect_resting(self, found: ti.types.ndarray()):
        for b in range(self.wall.count):
            total = self.sum(b, self.wall.x[b], self.motion.grid.geometry.cell(self.wall.x[b]))
            for d in ti.static(range(self.width)):
                found[b, d] = total[d]


def moments(arms: np.ndarray, push: np.ndarray) -> np.ndarray:
    """Torques [N m], (..., 1) in two dimensions and (..., 3) in three, of forces [N] at `arms` [m], (..., dim) both."""
    if arms.shape[-1] == 2:
        return arms[..., :1] * push[..., 1:] - arms[..., 1:] * push[..., :1]
    return np.cross(arms, push)


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
