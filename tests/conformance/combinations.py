"""What `Regional` can be asked for, in small two-dimensional impacts: each combination of levels, steps and rules."""

import itertools
from dataclasses import dataclass

import numpy as np

import taichi_rts as rts

LEVELS = (*range(1, 13), 16, 24, 32)
STEPS = ("integers", "half_octaves", "powers_of_two")
SOUND_SPEED = 40.0  # [m/s]
DROP_MACH = 0.2


@dataclass(frozen=True)
class Combination:
    levels: int
    steps: str
    grading: bool
    limiter: bool
    by_sound: bool

    @property
    def stepper(self):
        return rts.Regional(levels=self.levels, steps=self.steps, grading=self.grading, limiter=self.limiter)

    def of(self, scene):
        return scene.replace(sound_speed="regional") if self.by_sound else scene

    def __str__(self):
        flags = "".join(f" {name}" for name in ("grading", "limiter", "by_sound") if getattr(self, name))
        return f"{self.levels} {self.steps}{flags}"


ALL = [Combination(*each) for each in itertools.product(LEVELS, STEPS, *[(False, True)] * 3)]


def pairwise():
    """Of `ALL` so many that every two values of two parameters meet: each pair of levels and steps once, flags in turn."""
    turn = [(0, 0, 0), (1, 1, 0), (0, 1, 1), (1, 0, 1)]
    pairs = enumerate(itertools.product(range(len(LEVELS)), range(len(STEPS))))
    return [
        Combination(LEVELS[n], STEPS[k], *map(bool, turn[(n + 3 * k + number // 12) % 4])) for number, (n, k) in pairs
    ]


def drop_on_pool():
    """A block of 0.2 m falls on a pool."""
    block = rts.Block((0.4, 0.44), (0.6, 0.64), velocity=(0, -DROP_MACH * SOUND_SPEED))
    return rts.Scene(
        domain=rts.Box((0, 0), (1, 1)),
        fluids=[rts.Block((0, 0), (1, 0.4)), block],
        spacing=0.04,
        sound_speed=SOUND_SPEED,
        end_time=0.05,
    )


def run(scene, stepper, looks=40):
    """Largest energy over that of the start, largest density over rest, and updates of a debug run: no particle may be late."""
    sim = rts.Simulation(scene, stepper, debug=True)
    start = sim.energy().total
    energy = density = 0.0
    for time in np.linspace(0.0, scene.end_time, looks + 1)[1:]:
        sim.advance_to(time)
        gained = sim.energy().total - (sim.sound_work() if scene.regional_sound else 0.0)
        energy, density = max(energy, gained / start), max(density, sim.densities().max() / scene.rest_density)
    return energy, density, sim.statistics["particle_updates"]
