"""A slice of the paper's Figure 3 with the paper's setting, and its Figure 2: what happens without Serna's corrector."""

import numpy as np
import pytest

import taichi_rts as rts

DEPTH = 0.24
SCENE = rts.load_scene(
    "double_dam_break",
    spacing=0.04,
    domain=rts.Box((0, 0, 0), (3, 1.8, DEPTH)),
    fluids=(rts.Block((0, 0, 0), (0.6, 1, DEPTH)), rts.Block((2.4, 0, 0), (3, 1, DEPTH))),
)


def watch(start_taichi, quick, stepper, end_time):
    seen = {"speed": [], "density": [], "energy": []}
    with start_taichi("cpu", "f32", **quick):
        sim = rts.Simulation(SCENE, stepper)
        start = sim.energy().total
        for time in np.linspace(0, end_time, 7)[1:]:
            try:
                sim.advance_to(time)
            except rts.SimulationDivergedError:
                seen["speed"].append(np.inf)
                break
            seen["speed"].append(np.linalg.norm(sim.velocities(), axis=1).max())
            seen["density"].append(sim.densities().max() / SCENE.rest_density)
            seen["energy"].append(sim.energy().total / start)
        return seen | sim.statistics


@pytest.fixture(scope="module")
def corrected(start_taichi, quick):
    return watch(start_taichi, quick, rts.Regional(preset="paper"), 0.3)


def test_density_stays_within_8_percent(corrected):
    assert max(corrected["density"]) <= 1.08


def test_energy_is_not_gained(corrected):
    assert max(corrected["energy"]) <= 1.01


def test_about_half_of_the_particles_are_active_and_all_levels_appear(corrected):
    assert 0.40 <= corrected["active_fraction"] <= 0.60
    assert len(corrected["level_fractions"]) == 3
    assert min(corrected["level_fractions"]) > 0


def test_no_centre_had_to_be_stopped_by_the_domain(corrected):
    assert corrected["stopped_by_domain"] == 0


@pytest.mark.slow
def test_without_the_corrector_it_blows_up(start_taichi, quick, corrected):
    uncorrected = watch(start_taichi, quick, rts.Regional(preset="paper", corrector=False), 0.15)
    assert max(uncorrected["speed"]) > 3 * max(corrected["speed"])
