import math

import numpy as np
import pytest

from taichi_rts.device.backend import ti
from taichi_rts.medium.equation_of_state import Tait
from taichi_rts.solver.stepping import criteria


def test_eq_1():
    assert criteria.acoustic_step(0.4, 0.05, 20.0) == pytest.approx(1e-3, rel=1e-15)


def test_eq_2():
    assert criteria.force_step(0.25, 0.08, 8.0) == pytest.approx(0.025, rel=1e-15)
    assert criteria.force_step(0.25, 0.08, 0.0) == math.inf


def test_viscous_step():
    assert criteria.viscous_step(0.1, 0.01) == pytest.approx(0.125 * 0.05**2 / 0.01, rel=1e-15)
    assert criteria.viscous_step(0.1, 0.0) == math.inf


def test_fractions_of_eq_3():
    fractions = [criteria.velocity_fraction(n, 0.4, 0.4, 0.2) for n in (2, 3, 4)]
    assert fractions == pytest.approx([0.16, 0.032, 0.0064], rel=1e-14)


def test_compressed_water_is_stiffer(taichi_cpu_f64):
    medium = Tait(1000.0, 20.0)
    ratios = np.array([0.9, 1.0, 1.02, 1.03, 1.04, 1.4, 2.0])
    d = 1e-6
    sound = np.sqrt(
        (medium.pressure_numpy(1000 * (ratios + d)) - medium.pressure_numpy(1000 * (ratios - d))) / (2000 * d)
    )
    reach, signals, allowed = 0.04, np.empty(7), np.empty((7, 2), np.int32)

    @ti.kernel
    def look(ratio: ti.types.ndarray(), signal: ti.types.ndarray(), allow: ti.types.ndarray()):
        for k in range(7):
            signal[k] = criteria.signal_speed(20.0, criteria.stiffening(ratio[k]), 3.0)
            for m in range(2):
                step = reach / (signal[k] - 3.0) * (1.0 + 1e-5 * (2 * m - 1))
                allow[k, m] = ti.cast(criteria.allows_sound(step, reach, 20.0, ratio[k]), ti.i32)

    look(ratios, signals, allowed)
    assert (signals[:4] == 23.0).all()  # what calm water is compressed by shortens no step
    assert signals[4:] == pytest.approx(sound[4:] - criteria.MACH * 20.0 + 3.0, rel=1e-6)
    assert allowed.tolist() == [[1, 0]] * 7


def test_block_limits_agree_with_their_formulas(taichi_cpu_f64):
    step, lambda_f, support, fraction = 0.01, 0.25, 0.08, 0.16
    limit_a, limit_v = lambda_f**2 * support / step**2, fraction * support / step
    factors = np.array([0.0, 0.5, 1 - 1e-12, 1 + 1e-12, 2.0])

    @ti.kernel
    def allow(a2: ti.types.ndarray(), v2: ti.types.ndarray(), force: ti.types.ndarray(), velocity: ti.types.ndarray()):
        for k in range(5):
            force[k] = ti.cast(criteria.allows_force(step, lambda_f, support, a2[k]), ti.i32)
            velocity[k] = ti.cast(criteria.allows_velocity(step, fraction, support, v2[k]), ti.i32)

    force, velocity = np.empty(5, np.int32), np.empty(5, np.int32)
    allow((limit_a * factors) ** 2, (limit_v * factors) ** 2, force, velocity)
    assert force.tolist() == velocity.tolist() == [1, 1, 1, 0, 0]
