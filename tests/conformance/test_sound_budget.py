"""Where the energy goes when the sound speed is regional: an impact in two dimensions, without viscosity."""

import pytest

import taichi_rts as rts

SCENE = {
    "domain": rts.Box((0, 0), (1.0, 1.2)),
    "fluids": (rts.Block((0, 0), (1.0, 0.3)), rts.Block((0.4, 0.4), (0.6, 0.6), velocity=(0, -10.0))),
    "spacing": 0.025,
    "artificial_viscosity": 0.0,
    "sound_speed": "regional",
}


@pytest.fixture(scope="module")
def impact():
    rts.init("cpu", "f64")
    sim = rts.Simulation(rts.Scene(**SCENE), rts.Uniform(0.2, adaptive=True), debug=True)
    start = sim.energy().total
    sim.advance_to(0.3)
    return sim, start


@pytest.mark.slow
def test_energy_less_what_changes_of_sound_speed_do_is_kept(impact):
    """Measured: -2.5 % with that work left out, -27.1 % with it."""
    sim, start = impact
    change, work = sim.energy().total / start - 1.0, sim.sound_work() / start
    assert -0.05 < change - work < 0.0
    assert -0.3 < work < -0.1  # sound is damped, never fed


@pytest.mark.slow
def test_momentum_is_kept_to_rounding(impact):
    sim, _ = impact
    assert abs(sim.momentum_drift()).max() < 1e-12 * sim.medium.mass * sim.count * 10.0


@pytest.mark.slow
def test_calm_water_is_soft_again_and_all_is_within_the_rule(impact):
    sim, _ = impact
    sounds = sim.sound_speeds()
    one = 10.0 * sim.scene.estimate_max_speed()  # 109 m/s
    assert sounds.min() < 0.25 * one  # measured: 20.7 m/s, 1.4 times the smallest there may be
    assert sounds.mean() < 0.65 * one  # measured: 0.61
    assert (((sim.velocities() ** 2).sum(axis=1) ** 0.5) < 0.12 * sounds).all()


def test_auto_is_regional_only_where_steps_follow():
    scene = rts.Scene(**SCENE | {"sound_speed": "auto"})
    assert scene.with_sound_for(rts.Regional()).sound_speed == "regional"
    assert scene.with_sound_for(rts.Asynchronous()).sound_speed == "regional"
    assert scene.with_sound_for(rts.Uniform()).sound_speed is None
    assert scene.with_sound_for(rts.Regional(preset="paper")).sound_speed is None
    still = rts.load_scene("hydrostatic_column", sound_speed="auto")
    assert still.with_sound_for(rts.Regional()).sound_speed is None
