"""Front of a collapsing column against the experiment of Martin & Moyce 1952 (n^2 = 2, a = 2.25 in)."""

import numpy as np
import pytest

import taichi_rts as rts

A = 0.05715
TIMES = np.array([0.41, 0.84, 1.19, 1.43, 1.63, 1.83, 1.98, 2.20, 2.32, 2.51, 2.65, 2.83, 2.98, 3.11, 3.33])
FRONTS = np.array([1.11, 1.22, 1.44, 1.67, 1.89, 2.11, 2.33, 2.56, 2.78, 3.00, 3.22, 3.44, 3.67, 3.89, 4.11])


@pytest.fixture(scope="module")
def fronts(start_taichi):
    found = {}
    for stepper in (rts.Uniform(), rts.Regional(), rts.Asynchronous()):
        with start_taichi("cpu", "f32"):
            sim = rts.Simulation(rts.load_scene("martin_moyce", spacing=A / 8), stepper)
            front = []
            for time in TIMES / np.sqrt(2 * 9.81 / A):
                sim.advance_to(time)
                front.append(np.sort(sim.positions()[:, 0])[-5] / A)  # the fifth-largest x: one lone drop is no front
            found[stepper.name] = np.array(front)
    return found


@pytest.mark.parametrize("stepper", ["uniform", "regional", "asynchronous"])
def test_front_follows_the_experiment(fronts, stepper):
    assert np.abs(fronts[stepper] / FRONTS - 1).mean() <= 0.10


@pytest.mark.parametrize("stepper", ["regional", "asynchronous"])
def test_the_front_is_that_of_uniform_steps(fronts, stepper):
    errors = {name: np.abs(front / FRONTS - 1).mean() for name, front in fronts.items()}
    assert abs(errors[stepper] - errors["uniform"]) < 0.02
    assert fronts[stepper].mean() == pytest.approx(fronts["uniform"].mean(), rel=0.03)
    assert np.abs(fronts[stepper] / fronts["uniform"] - 1).max() < 0.03
