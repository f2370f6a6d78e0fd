"""Aligned blocks whose levels follow the regional sound speed (docs/regional_sound_speed.md)."""

from taichi_rts.device.backend import ti
from taichi_rts.solver.stepping import criteria
from taichi_rts.solver.stepping.aligned import AlignedBlocks
from taichi_rts.solver.stepping.settled import SettledRegions
from taichi_rts.solver.stepping.timeline import Timeline


@ti.data_oriented
class BlocksBySound(AlignedBlocks):
    """Level n means that Eq. 1 holds for n base steps with the block's own sound speed, which follows the velocity (Eq. 3)."""

    reach_of_regions = 2  # the sound speed has spread by a block already

    @classmethod
    def ratio_sweeps(cls, levels: int) -> int:
        """One: sound speeds are graded already; forces are not, but reach no further."""
        return min(1, super().ratio_sweeps(levels))

    def retime(self, settled: SettledRegions, timeline: Timeline | None = None) -> bool:
        """Take another courant."""
        self.reach = settled.courant * self.support
        return True

    @ti.func
    def is_stale(self, block):
        """Sound speeds around it may have changed."""
        return True

    @ti.func
    def region_of(self, block, now, tick, reach):
        """The largest level for which Eq. 1 holds with the block's sound speed, Eq. 2 and the viscous limit.

        (The sound speed's rule has reduced the block already.)
        """
        acceleration2, viscosity = self.sound.acceleration2[block], self.sound.viscosity[block]
        sound = self.sound.limit[block]
        level = 1
        for n in ti.static(self.lengths[1:]):
            step = tick * n
            if criteria.allows_force(step, self.lambda_f, self.support, acceleration2):
                if criteria.allows_viscosity(step, self.support, viscosity):
                    if step * sound <= reach * (1.0 + 1e-6):
                        level = n
        return level
