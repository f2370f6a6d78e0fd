"""A simulation that goes on with another stepper."""

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.output.change_stepper import hand_over

SCENE = rts.Scene(
    domain=rts.Box((0, 0), (1, 1)),
    fluids=[rts.Block((0, 0), (0.4, 0.6)), rts.Block((0.6, 0), (1, 0.1), kinematic_viscosity=0.01)],
    spacing=0.05,
    inflows=[rts.Inflow((0.8, 1), (0.9, 1), (0, -3))],
    outlets=[rts.Outlet((0.5, 0), (0.6, 0.2))],
    moving_walls=[rts.MovingWall("x-", (0.05, 0.3), (0, 0.1))],
    end_time=0.4,
)
STEPPERS = [rts.Regional(levels=3), rts.Asynchronous()]


@pytest.mark.slow
def test_reset_gives_the_bits_of_a_new_run_and_a_change_goes_on(start_taichi, quick):
    with start_taichi("cpu", "f64", **quick):
        sims = [rts.Simulation(SCENE, stepper) for stepper in STEPPERS]
        starts = [sim.snapshot() for sim in sims]
        first = []
        for sim in sims:
            sim.advance_to(0.2)
            first.append([sim.ids(), *sim.state()])
        assert sims[0].removed_count > 0
        for sim, start, seen in zip(sims, starts, first, strict=True):
            sim.continue_from(start)
            assert sim.time == 0.0
            assert sim.removed_count == 0
            sim.advance_to(0.2)
            for one, other in zip([sim.ids(), *sim.state()], seen, strict=True):
                np.testing.assert_array_equal(one, other)
        regional, asynchronous = sims
        for one, other in ((regional, asynchronous), (asynchronous, regional)):
            hand_over(one, other)
            assert one.time == other.time == pytest.approx(other.timeline.time)
            assert one.removed_count == other.removed_count
            np.testing.assert_array_equal(one.ids(), other.ids())
            np.testing.assert_array_equal(one.positions(), other.positions())
            np.testing.assert_array_equal(one.velocities(), other.velocities())
            before = other.statistics["base_steps"]
            other.advance_to(one.time + 0.03)
            assert other.statistics["base_steps"] > before
            one.advance_to(other.time)
            np.testing.assert_allclose(one.energy().total, other.energy().total, rtol=0.01)
            assert one.inflows.entered == other.inflows.entered
            both = np.isin(one.ids(), other.ids()), np.isin(other.ids(), one.ids())
            gap = one.positions()[both[0]] - other.positions()[both[1]]
            assert np.abs(gap).max() < 0.1 * SCENE.spacing
        assert 0.3 < regional.statistics["active_fraction"] < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("density", ["summation", "continuity"])
def test_change_of_stepper_and_viscosity(simulate, density):
    changes = {"sound_speed": "regional"} if density == "summation" else {"density": density}
    still = SCENE.replace(inflows=(), outlets=(), moving_walls=(), **changes)
    sim = simulate(still, rts.Uniform(courant=0.3))
    sim.advance_to(0.1)
    other = rts.change_stepper(sim, rts.Regional(), kinematic_viscosity=0.02)
    assert other.scene.kinematic_viscosity == 0.02
    assert other.time == sim.time == pytest.approx(0.1, abs=other.timeline.tick)
    viscosity = other.particles.to_numpy(other.particles.viscosity)
    assert set(viscosity.tolist()) == {0.02, 0.01}
    np.testing.assert_array_equal(viscosity == 0.01, other.positions()[:, 0] > 0.59)
    assert np.abs(other.densities() / sim.densities() - 1.0).max() < (1e-9 if density == "continuity" else 5e-3)
    other.advance_to(0.12)
    assert other.energy().total < sim.energy().total
