"""The rule of the regional sound speed: what c a block needs."""

from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.device.fields import Declared, Part, reals, within
from taichi_rts.medium.equation_of_state import tait
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.surroundings import Surroundings
from taichi_rts.solver.particles.extra import Extra
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping import criteria
from taichi_rts.solver.stepping.limits import BlockMaxima

SLACK = 2.0
"""How many times what the pressure asks for a sound speed may be before it falls.

Without slack it follows the pressure of every slow wave, and the reference density follows the sound speed a quarter of a period
late: that feeds the wave, and a ringing pool never comes to rest. What speed asks for needs no slack.
Kinetic energy after 2 s over that with one sound speed: 15 times without slack, 0.8 times with it
(tests/conformance/test_still_regional_pool.py).
"""


@ti.data_oriented
class SoundRule(Part, Extra):
    """c_b = max(|v|, sqrt(<p>/rho_0)) / mach over the block and those around it, and at least half of a neighbour's.

    Why: density then varies by mach^2 (1 %) everywhere, as it does in the whole with one sound speed of ten times the largest
    speed. By speed, |v|/c <= mach, over all particles; by pressure, p/(rho_0 c^2) <= mach^2, its mean over the block,
    because single particles are noisy. Pressure is what speed does not see: depth, the stagnation point under an impact, and the
    wave that runs ahead of it into still water. The blocks around count because fluid must be stiff before the fast fluid
    arrives. Half of the neighbours', because the steps do not differ by more either, so that a smoother transition, which
    reflects less sound, costs nothing. There are a floor, for water that has not settled yet, and a cap, which sets the
    base step.

    `target` [m/s] is c_b, below which no sound speed stays; above `ceiling` it falls, which is the same with `SLACK` times the
    share of the pressure; `limit` is the largest sound speed that is really there, which bounds the steps. (blocks,) each, 0
    in empty blocks. On the way are found `acceleration2` and `viscosity`, the squares of the largest acceleration
    [m^2/s^4] and the largest viscosity [m^2/s] of each block.
    """

    def __init__(self, scene: Scene, particles: FluidState, grid: BlockGrid) -> None:
        description = scene.regional_sound
        assert description is not None
        self.particles = particles
        self.grid = grid
        self.geometry = grid.geometry
        self.maxima = BlockMaxima(scene, particles, grid)
        self.around = Surroundings(grid)
        grid.track_vacated()
        self.cap = scene.wave_speed
        self.floor = scene.least_wave_speed
        self.rest_density = scene.rest_density
        self.inverse_mach2 = 1.0 / description.mach**2
        self.forgetting = 1.0 / (description.memory * scene.support)
        """1/(memory r) [1/m]: times c, the rate at which sound speeds fall and reference densities relax."""
        self.blocks = grid.geometry.blocks
        self.make_fields(self.fields(self.blocks))

    @staticmethod
    def fields(blocks: int) -> list[Declared]:
        """Declare the fields for `blocks`.

        Besides those that the class describes: `wish` is what a block needs for itself, `wish_ceiling` the same with slack, `own`
        the largest sound speed of its particles at their present compression, and `felt` what its neighbours take into account,
        its own need and half of its target.
        """
        own = reals(blocks, "wish", "wish_ceiling", "own", "felt")
        given = reals(blocks, "target", "ceiling", "limit", "acceleration2", "viscosity")
        return own + given + within("grid", BlockGrid.vacated_fields(blocks))

    def update(self, read_at: ti.Field, now: int, tick: float) -> None:
        """Work out the targets and limits of all blocks at tick `now`.

        Targets spread by one block per call, faster than any wave. Only blocks that were read in the last step (their
        `read_at` is not negative), or that a particle has come into since, are worked out again, and all of them now and
        then: in the others no particle has stepped. With less (only blocks that have stepped, and never all) an oscillating
        pool of 1 m has four to ten times the energy after 20 s.
        """
        self.work_out(read_at, now, tick)

    def before_regions(self, schedule: Any, now: int, tick: float) -> None:
        """Work out the targets, unless the schedule does it for the blocks that step."""
        if schedule.needs_sound:
            self.update(schedule.read_at, now, tick)

    def kept(self, tick: float) -> Any:
        """Sound speeds [m/s] and reference densities [kg/m^3], (N,) each, by id."""
        p = self.particles
        return p.to_numpy(p.sound), p.to_numpy(p.reference)

    def go_on(self, kept: Any, now: int, tick: float) -> None:
        """Go on from there; every target is worked out anew."""
        p = self.particles
        for field in vars(self).values():
            if isinstance(field, ti.Field):
                field.fill(0)
        sound, reference = kept or (self.floor, self.rest_density)
        p.put(p.sound, sound, self.floor)
        p.put(p.reference, reference, self.rest_density)

    def update_some(self, cells: Any, tick: float) -> None:
        """Do the same for the cells that have just stepped (`cells.Cells`), each at its own time, and those beside."""
        self.work_out_some(cells.block_due, cells.time, cells.read_at, tick)

    @ti.kernel
    def work_out(
        self, read_at: ti.template(), now: ti.i32, tick: float
    ):  # one kernel, because launches cost more than the last loops
        ti.loop_config(serialize=self.grid.serial)  # they are few
        for m in range(self.grid.vacated_count[None]):
            self.forget(self.grid.vacated[m])
        for m in range(self.grid.occupied_count[None]):
            block = self.grid.occupied[m]
            if self.is_stale(block, read_at[block]):
                self.look_at(block, now, tick)
            self.felt[block] = ti.max(self.wish[block], 0.5 * self.target[block])
        self.around.visit(self, False, ti.Vector([0.0, 0.0]))

    @ti.kernel
    def work_out_some(
        self,
        due: ti.template(),
        time: ti.template(),
        read_at: ti.template(),
        tick: float,
    ):
        for m in range(self.grid.occupied_count[None]):
            block = self.grid.occupied[m]
            if due[block] > 0:
                self.look_at(block, time[block], tick)
            self.felt[block] = ti.max(self.wish[block], 0.5 * self.target[block])
        for m in range(self.grid.occupied_count[None]):
            block = self.grid.occupied[m]
            if read_at[block] >= 0:
                around = ti.Vector([0.0, 0.0])
                for k in ti.static(range(len(self.geometry.offsets))):
                    around = ti.max(around, self.read(self.geometry.beside(block, k)))
                self.finish(block, around)

    @ti.func
    def is_stale(self, block, read_at):
        """Whether the values of an occupied block may have changed since they were worked out."""
        stale = read_at >= 0 or self.wish[block] == 0.0
        if ti.static(self.grid.tracks_arrivals):
            stale = stale or self.grid.arrived[block] == 1
        return stale

    @ti.func
    def look_at(self, block, now, tick):
        """Work out what an occupied block needs for itself at tick `now`, and its largest sound speed."""
        first, end = self.grid.first(block), self.grid.first(block + 1)
        own, acceleration2, viscosity = (
            0.0,
            0.0,
            0.0 if ti.static(self.particles.has_viscosity) else self.maxima.viscosity,
        )
        p = self.particles
        speed2, pressure = self.maxima.wall_speed2(block, now, tick), 0.0
        for k in range(first, end):
            i = self.grid.order[k]
            a = p.a[i]
            v = p.v[i] + a * (ti.cast(now - p.updated[i], float) * tick)
            speed2 = ti.max(speed2, v.norm_sqr())
            acceleration2 = ti.max(acceleration2, a.norm_sqr())
            ratio, c2 = p.rho[i] / p.reference[i], p.sound[i] * p.sound[i]
            own = ti.max(own, p.sound[i] * criteria.stiffening(ratio))
            pressure += ti.max(0.0, tait(self.rest_density / 7.0 * c2, ratio))
            if ti.static(p.has_viscosity):
                viscosity = ti.max(viscosity, p.viscosity[i])
        mean = pressure / (ti.cast(end - first, float) * self.rest_density)
        self.wish[block] = self.within(ti.max(speed2, mean))
        self.wish_ceiling[block] = self.within(ti.max(speed2, SLACK * SLACK * mean))
        self.own[block] = own
        self.acceleration2[block] = acceleration2
        self.viscosity[block] = viscosity

    @ti.func
    def within(self, speed2):
        """Sound speed [m/s] for speeds or roots of p/rho_0 of `speed2` [m^2/s^2], between floor and cap."""
        return ti.min(ti.max(ti.sqrt(speed2 * self.inverse_mach2), self.floor), self.cap)

    @ti.func
    def read(self, block):
        """What neighbours see of `block`."""
        return ti.Vector([self.felt[block], self.wish_ceiling[block]])

    @ti.func
    def finish(self, block, around):
        """Work out the new target of an occupied block from its own wish and from what is seen of those `around` it.

        That is their wishes, and half of their targets so far.
        """
        target = ti.max(self.wish[block], around[0])
        self.target[block] = target
        self.ceiling[block] = ti.max(target, ti.max(self.wish_ceiling[block], around[1]))
        self.limit[block] = ti.max(target, self.own[block])

    @ti.func
    def forget(self, block):
        """An empty block requires no sound speed."""
        for field in ti.static((self.wish, self.wish_ceiling, self.felt, self.target, self.ceiling, self.limit)):
            field[block] = 0.0
