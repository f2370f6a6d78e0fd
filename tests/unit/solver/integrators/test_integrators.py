import numpy as np
import pytest

from taichi_rts.device.backend import ti
from taichi_rts.solver.integrators.serna import Serna
from taichi_rts.solver.integrators.symplectic_euler import SymplecticEuler


def oscillate(integrator, dt, steps, samples=1):
    """Harmonic oscillator a = -x from x = 1, v = 0; returns x, v after each of `samples` stretches of `steps`."""

    @ti.kernel
    def run(state: ti.types.ndarray()):
        ti.loop_config(serialize=True)
        for s in range(samples):
            x, v, a = 1.0, 0.0, -1.0
            if s > 0:
                x, v, a = state[s - 1, 0], state[s - 1, 1], -state[s - 1, 0]
            for _ in range(steps):
                predicted = integrator.predict_position(x, v, a, dt)
                a_new = -predicted
                v = integrator.correct_velocity(v, a, a_new, dt)
                x = integrator.correct_position(predicted, a, a_new, dt)
                a = a_new
            state[s, 0] = x
            state[s, 1] = v

    state = np.empty((samples, 2))
    run(state)
    return state


def single_step(integrator, *values):
    @ti.kernel
    def run(result: ti.types.ndarray(), x: float, v: float, a: float, a_new: float, dt: float):
        for _ in range(1):
            predicted = integrator.predict_position(x, v, a, dt)
            result[0] = predicted
            result[1] = integrator.predict_velocity(v, a, dt)
            result[2] = integrator.correct_position(predicted, a, a_new, dt)
            result[3] = integrator.correct_velocity(v, a, a_new, dt)

    result = np.empty(4)
    run(result, *values)
    return result


def test_serna_is_eq_4_to_7(taichi_cpu_f64):
    x, v, a, a_new, dt = 0.3, -1.7, 9.0, 4.0, 0.01
    predicted = [x + v * dt + a * dt**2 / 2, v + a * dt]
    corrected = [predicted[0] + (a_new - a) * dt**2 / 6, predicted[1] + (a_new - a) * dt / 2]
    np.testing.assert_allclose(single_step(Serna(), x, v, a, a_new, dt), predicted + corrected, rtol=1e-15)
    np.testing.assert_allclose(single_step(Serna(False), x, v, a, a_new, dt), predicted * 2, rtol=1e-15)


def test_symplectic_euler_is_kick_then_drift(taichi_cpu_f64):
    x, v, a, a_new, dt = 0.3, -1.7, 9.0, 4.0, 0.01
    u = v + a * dt / 2
    expected = [x + u * dt, u, x + u * dt, u + a_new * dt / 2]
    np.testing.assert_allclose(single_step(SymplecticEuler(), x, v, a, a_new, dt), expected, rtol=1e-15)


@pytest.mark.parametrize("integrator", [Serna(), SymplecticEuler()], ids=lambda i: i.name)
def test_second_order(taichi_cpu_f64, integrator):
    errors = [abs(oscillate(integrator, 1 / n, n)[0, 0] - np.cos(1.0)) for n in (20, 40)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)


def test_without_the_corrector_energy_grows(taichi_cpu_f64):
    with_it = 0.5 * (oscillate(Serna(), 0.05, 2000)[0] ** 2).sum()
    without = 0.5 * (oscillate(Serna(False), 0.05, 2000)[0] ** 2).sum()
    assert with_it < 0.5 * 1.01
    assert without > 2.0


def test_symplectic_euler_keeps_its_energy(taichi_cpu_f64):
    energy = 0.5 * (oscillate(SymplecticEuler(), 0.1, 1000, samples=20) ** 2).sum(axis=1)
    assert np.abs(energy - 0.5).max() < 0.5 * 0.1**2
