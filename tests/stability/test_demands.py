import math

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.medium.equation_of_state import Tait
from taichi_rts.trials.demands import demanded_density, impact_speed, jump_density, jump_mach, still_density

C = 40.0


def tank(*fluids, **changes):
    fields = {"domain": rts.Box((0, 0), (1, 1)), "fluids": fluids, "spacing": 0.05, "sound_speed": C}
    return rts.Scene(**(fields | changes))


def test_a_jump_solved_by_hand():
    # rho = 1.4 rho_0: p / (rho_0 c^2) = (1.4^7 - 1)/7 = 9.541350/7 = 1.363050; u^2/c^2 = 1.363050 (1 - 1/1.4) = 0.389443
    assert jump_density(math.sqrt(0.389443)) == pytest.approx(1.4, abs=1e-6)


@pytest.mark.parametrize("mach", [0.01, 0.3, 0.7, 3.0])
def test_a_jump_conserves_mass_and_momentum(mach):
    ratio = jump_density(mach)
    shock = mach * ratio / (ratio - 1.0)  # U / c_s from rho_0 U = rho (U - u)
    pressure = Tait(1000.0, C).pressure_numpy(1000.0 * ratio)
    assert 1000.0 * (shock * C) * (mach * C) == pytest.approx(float(pressure), rel=1e-6)
    assert jump_mach(ratio) == pytest.approx(mach)


def test_a_weak_jump_is_acoustic():
    assert jump_density(1e-3) == pytest.approx(1.001, abs=2e-6)
    assert jump_density(0.0) == 1.0


def test_still_fluid_is_in_hydrostatic_balance():
    # integrate dp/dz = rho g over a depth that compresses by 10 %
    eos, g, depth = Tait(1000.0, C), 9.81, 16.0
    rho, steps = 1000.0, 20000
    for _ in range(steps):
        rho += rho * g * depth / steps / (C**2 * (rho / 1000.0) ** 6)
    assert still_density(g * depth, C) == pytest.approx(rho / 1000.0, rel=1e-5)
    assert eos.pressure_numpy(rho) > 0


def test_a_still_pool_demands_only_its_depth():
    pool = tank(rts.Block((0, 0), (1, 0.4)))
    assert impact_speed(pool) == 0.0
    assert demanded_density(pool) == pytest.approx((1 + 6 * 9.81 * 0.4 / C**2) ** (1 / 6))


def test_a_dam_falls_from_above_the_settled_depth():
    dam = tank(rts.Block((0, 0), (0.5, 0.8)))
    assert impact_speed(dam) == pytest.approx(math.sqrt(2 * 9.81 * 0.4))


def test_speed_and_fall_add_up():
    drop = tank(rts.Block((0.4, 0.4), (0.6, 0.6), velocity=(3, -4)))
    assert impact_speed(drop) == pytest.approx(math.sqrt(25 + 2 * 9.81 * (0.6 - 0.04)))
    assert demanded_density(drop) == pytest.approx(jump_density(impact_speed(drop) / C))


def test_no_gravity_and_no_motion_demand_nothing():
    assert demanded_density(tank(rts.Block((0, 0), (0.2, 0.2)), gravity=(0, 0))) == 1.0


def test_a_body_force_counts():
    force = rts.LinearField(((-100.0, 0.0), (0.0, -100.0)), origin=(0.5, 0.5))
    scene = tank(rts.Sphere((0.5, 0.5), 0.2), gravity=(0, 0), body_force=force)
    assert demanded_density(scene) >= still_density(0.5 * 100 * 0.2**2, C)
    assert np.isfinite(demanded_density(scene))
