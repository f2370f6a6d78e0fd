"""The last ticks that a run may have give the bits of the first: what is due is integer arithmetic, and none of it overflows."""

import dataclasses

import pytest

import taichi_rts as rts
from taichi_rts.solver.stepping.timeline import MAX_TICKS

TICKS = 72  # a multiple of all steps, as is `MAX_TICKS`: steps that are aligned then meet the same phase


@pytest.mark.slow
@pytest.mark.parametrize(
    "stepper",
    [
        rts.Asynchronous(),
        rts.Uniform(adaptive=True),
        rts.Regional(),
        rts.Regional(preset="paper"),
    ],
    ids=lambda stepper: stepper.name,
)
def test_the_last_ticks_are_like_the_first(simulate, stepper):
    sim = simulate(rts.load_scene("dam_break_2d", particles=100, end_time=0.1), stepper)
    start, tick = sim.snapshot(), sim.timeline.tick
    states = []
    for begin in (0, MAX_TICKS - TICKS):
        sim.continue_from(dataclasses.replace(start, time=begin * tick))
        sim.advance_to((begin + TICKS) * tick)
        states.append([field.to_numpy() for field in (sim.particles.x, sim.particles.v, sim.particles.rho)])
    for first, last in zip(*states, strict=True):
        assert first.tobytes() == last.tobytes()
    with pytest.raises(rts.TimeError, match="beyond the longest run"):
        sim.advance_to((MAX_TICKS + 1.5) * tick)
