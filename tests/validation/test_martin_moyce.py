"""A collapsing column against the experiment of Martin & Moyce 1952 (n^2 = 2, a = 2.25 in)."""

import numpy as np
import pytest
from cases import FRONT_TIMES, HEIGHT, HEIGHT_TIMES
from experiments import MARTIN_MOYCE_A, MARTIN_MOYCE_FRONT, column_height, front

import taichi_rts as rts

SPACING = MARTIN_MOYCE_A / 8
FRONTS = MARTIN_MOYCE_FRONT[:, 1]


@pytest.fixture(scope="module")
def columns(start_taichi, quick):
    """Fronts over a and heights over the first, by stepper."""
    found = {}
    for stepper in (rts.Uniform(), rts.Regional(), rts.Asynchronous()):
        with start_taichi("cpu", "f32", **quick):
            sim = rts.Simulation(rts.load_scene("martin_moyce", spacing=SPACING), stepper)
            fronts, heights = {}, {}
            for time in np.union1d(FRONT_TIMES, HEIGHT_TIMES):
                sim.advance_to(time)
                fronts[time] = front(sim.positions()) / MARTIN_MOYCE_A
                heights[time] = column_height(sim.positions(), SPACING) / (2 * MARTIN_MOYCE_A)
            found[stepper.name] = (
                np.array([fronts[t] for t in FRONT_TIMES]),
                np.array([heights[t] for t in HEIGHT_TIMES]),
            )
    return found


@pytest.fixture(scope="module")
def fronts(columns):
    return {name: found[0] for name, found in columns.items()}


@pytest.mark.parametrize("stepper", ["uniform", "regional", "asynchronous"])
def test_front_follows_the_experiment(fronts, stepper):
    off = fronts[stepper] / FRONTS - 1
    assert np.abs(off).mean() <= 0.07  # measured 0.059
    assert -0.075 < off.mean() < -0.038  # measured -0.057; gravity times 1.1: -0.016, over 1.1: -0.095


@pytest.mark.parametrize("stepper", ["uniform", "regional", "asynchronous"])
def test_column_falls_as_in_the_experiment(columns, stepper):
    off = columns[stepper][1] - HEIGHT[:, 1]
    # SPH columns stand a little higher than the experiment's. Measured 0.070; gravity times 1.1: 0.054, over 1.1: 0.083
    assert 0.06 < off.mean() < 0.08


@pytest.mark.parametrize("stepper", ["regional", "asynchronous"])
def test_the_front_is_that_of_uniform_steps(fronts, stepper):
    errors = {name: np.abs(front / FRONTS - 1).mean() for name, front in fronts.items()}
    assert abs(errors[stepper] - errors["uniform"]) < 0.02
    assert fronts[stepper].mean() == pytest.approx(fronts["uniform"].mean(), rel=0.03)
    assert np.abs(fronts[stepper] / fronts["uniform"] - 1).max() < 0.03
