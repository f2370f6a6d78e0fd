import numpy as np
import pytest
from problems import PROBLEMS

import taichi_rts as rts

SCENE, STEPPER, TIME = PROBLEMS["dam_break_3d"].scene, rts.Regional(), 0.03


def run():
    sim = rts.Simulation(SCENE, STEPPER)
    sim.advance_to(TIME)
    assert sim.statistics["base_steps"] >= 15
    return sim.state()


def assert_agree(one, two):
    for a, b in zip(one[:3], two[:3], strict=True):  # positions, velocities, densities
        assert np.abs(a - b).max() <= 1e-4 * np.abs(b).max()
    assert (one[3] != two[3]).mean() < 0.05


@pytest.fixture(scope="module")
def single(start_taichi):
    with start_taichi("cpu", "f32"):
        return run()


@pytest.mark.slow
def test_single_and_double_precision_agree(single, taichi_cpu_f64):
    double = run()
    assert (single[0].dtype, double[0].dtype) == (np.float32, np.float64)
    assert_agree(single, double)


def test_vulkan_and_cpu_agree(single, taichi_vulkan):
    assert_agree(run(), single)


@pytest.mark.slow
def test_asynchronous_cells_step_alike_on_vulkan_and_cpu(start_taichi, taichi_vulkan):
    """With random ages cells hold particles of several times: a kernel that loses some of them never comes to an end."""

    def counts():
        sim = rts.Simulation(rts.load_scene("dam_break_2d", spacing=0.1), rts.Asynchronous(stagger=1))
        sim.advance_to(0.03)
        return [sim.statistics[name] for name in ("base_steps", "passes", "particle_updates", "wakes")]

    on_vulkan = counts()
    with start_taichi("cpu", "f32"):
        assert counts() == on_vulkan == [132, 19, 1765, 0]
