import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.trials.rerun import Rerun

POOL, BLOCK = rts.Block((0, 0), (0.8, 0.3)), rts.Block((0.2, 0.35), (0.5, 0.6), velocity=(0, -15))
SCENE = rts.Scene(domain=rts.Box((0, 0), (0.8, 0.8)), fluids=[POOL, BLOCK], spacing=0.05, sound_speed=40, walls=False)


def state_after(sim):
    sim.advance_to(0.02)
    found = [*sim.state(), sim.energy(), sim.statistics["particle_updates"], sim.timeline.now]
    sim.schedule.needs_sorting = False  # as some runs end
    return found


@pytest.mark.slow
def test_a_rerun_is_a_new_run_to_the_last_bit(start_taichi, quick):
    again = Rerun(lambda: None)
    with start_taichi("cpu", "f32", **quick, unrolling_limit=0):
        first, _, again_first = (state_after(again(SCENE, rts.Asynchronous(courant=c))) for c in (0.2, 0.3, 0.2))
        assert again.builds == 1
    for one, other in zip(first, again_first, strict=True):
        assert np.array_equal(one, other)


def test_another_number_of_ticks_needs_other_kernels(start_taichi, quick):
    scene = SCENE.replace(
        kinematic_viscosity=0.0, fluids=[POOL, rts.Block((0, 0.4), (0.4, 0.6), kinematic_viscosity=10.0)]
    )
    with start_taichi("cpu", "f32", **quick):
        sim = rts.Simulation(scene, rts.Asynchronous(courant=0.4), started=False)
        for courant, serves in ((0.39, True), (0.1, False)):
            stepper = rts.Asynchronous(courant=courant)
            assert sim.schedule.retime(stepper.in_scene(scene), stepper.timeline(scene)) == serves
