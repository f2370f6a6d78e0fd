from types import SimpleNamespace

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.compare import measures
from taichi_rts.compare.measures import ERRORS, MATCHED, Yardstick, judge, parting
from taichi_rts.compare.trajectory import Trajectory
from taichi_rts.scene.near_pairs import mean_neighbours

SCENE = rts.Scene(domain=rts.Box((0, 0), (2, 2)), fluids=[rts.Block((0, 0), (1, 1))], spacing=0.1)


def state(time, x, v, rho, p, energy):
    """What a trajectory takes of a reading."""
    return SimpleNamespace(time=time, positions=x, velocities=v, densities=rho, pressures=p, energy=energy)


def drifting(speeds, shift=0.0, scale=1.0):
    """A lattice that moves along x, with the speeds given at samples one second apart."""
    x = np.stack(np.meshgrid(np.arange(10), np.arange(10), indexing="ij"), axis=-1).reshape(-1, 2) * 0.1 + 0.05
    run = Trajectory()
    for k, speed in enumerate(speeds):
        v = np.zeros_like(x)
        v[:, 0] = speed * scale
        moved = x + np.array([0.01 * k + (shift if k else 0.0), 0.0])
        run.append(state(k, moved, v, np.full(len(x), 1000.0), np.zeros(len(x)), (speed**2, 2.0 * speed, 0.0)))
    return run


def test_errors_of_a_run_with_itself_are_zero():
    run = drifting([0.0, 1.0, 2.0])
    assert set(judge(run, run, Yardstick.of(SCENE, run), 2).values()) == {0.0}


def test_relative_l2_norms_at_matched_ids():
    reference = drifting([1.0, 1.0, 1.0])
    scale = Yardstick.of(SCENE, reference)
    faster = drifting([1.0, 1.0, 1.0], scale=1.1)
    assert ERRORS["velocities"](faster, reference, scale, 2) == pytest.approx(0.1)
    assert ERRORS["positions"](faster, reference, scale, 2) == 0.0
    shifted = drifting([1.0, 1.0, 1.0], shift=0.002)
    expected = np.sqrt((0.2**2 + 0.1**2) / 2)  # 0.002 of 0.01 m, then of 0.02 m
    assert ERRORS["positions"](shifted, reference, scale, 2) == pytest.approx(expected)
    assert ERRORS["positions"](shifted, reference, scale, 1) == pytest.approx(0.2)
    assert ERRORS["velocities"](faster, reference, scale, 0) is None


def test_robust_errors_are_over_the_whole_run_and_dimensionless():
    reference = drifting([1.0, 1.0, 2.0])
    scale = Yardstick.of(SCENE, reference)
    assert scale.length == pytest.approx(1.0)
    assert scale.energy == 4.0
    shifted = drifting([1.0, 1.0, 2.0], shift=0.02)
    assert ERRORS["front"](shifted, reference, scale, 0) == pytest.approx(0.02)
    assert ERRORS["centre_of_mass"](shifted, reference, scale, 0) == pytest.approx(0.02)
    faster = drifting([1.0, 1.0, 3.0])
    assert ERRORS["kinetic_energy"](faster, reference, scale, 0) == pytest.approx((5.0 / 4.0) / np.sqrt(2))
    assert ERRORS["potential_energy"](faster, reference, scale, 0) == pytest.approx((2.0 / 4.0) / np.sqrt(2))
    assert ERRORS["momentum"](faster, reference, scale, 0) == pytest.approx(0.5 / np.sqrt(2))


def test_the_front_is_the_fifth_largest_x():
    run = drifting([0.0])
    run.positions[0][:4, 0] = 1.9  # drops that flew ahead
    assert measures.front_position(run, 0) == pytest.approx(0.95)
    run.positions[0][4, 0] = 1.5
    assert measures.front_position(run, 0) == pytest.approx(1.5)


def test_density_compares_compression_only():
    reference, other = drifting([1.0, 1.0]), drifting([1.0, 1.0])
    scale = Yardstick.of(SCENE, reference)
    other.densities[1] = np.full(100, 500.0)  # a free surface has little
    assert ERRORS["density"](other, reference, scale, 1) == 0.0
    other.densities[1] = np.full(100, 1020.0)
    assert ERRORS["density"](other, reference, scale, 1) == pytest.approx(0.02)


def test_pressure_at_probes_is_a_weighted_mean():
    run = drifting([1.0, 1.0])
    scale = Yardstick.of(SCENE, run)
    expected = scale.medium.equation_of_state.pressure_numpy(1010.0)
    run.pressures[1] = np.full(100, expected)
    inside = (scale.probes[:, 0] < 1.1) & (scale.probes[:, 1] < 1.1)
    np.testing.assert_allclose(measures.probe_pressures(run, 1, scale)[inside], expected)
    assert (measures.probe_pressures(run, 1, scale)[~inside] == 0.0).all()
    assert 3 <= inside.sum() < len(inside)


def test_runs_part_where_velocities_differ_by_more_than_one_percent():
    reference = drifting([1.0, 1.0, 1.0, 1.0])
    assert parting(drifting([1.0, 1.005, 1.009, 1.011]), reference) == 2
    assert parting(drifting([1.0, 1.02, 1.0, 1.0]), reference) == 0
    assert parting(reference, reference) == 3


def test_positions_differ_by_the_nearest_image_along_periodic_axes():
    one, two = np.array([[0.05, 0.1]]), np.array([[1.95, 0.3]])
    periods = np.array([2.0, np.inf])
    np.testing.assert_allclose(measures.differences(one, two, periods), [[0.1, -0.2]])
    np.testing.assert_allclose(measures.differences(one, two, np.full(2, np.inf)), [[-1.9, -0.2]])


def test_particles_that_only_one_run_has_are_left_out():
    reference, longer = drifting([1.0, 1.0]), drifting([1.0, 1.0])
    scale = Yardstick.of(SCENE, reference)
    longer.positions[1] = np.concatenate([longer.positions[1], [[1.5, 1.5]]])
    longer.velocities[1] = np.concatenate([longer.velocities[1], [[9.0, 0.0]]])
    assert [ERRORS[name](longer, reference, scale, 1) for name in MATCHED] == [0.0, 0.0]


def test_a_trajectory_survives_its_file():
    run = drifting([0.0, 1.0])
    run.append(state(2.0, np.zeros((3, 2)), np.ones((3, 2)), np.ones(3), np.ones(3), (1.0, 2.0, 3.0)))
    read = Trajectory.from_bytes(run.to_bytes())
    assert read.times == run.times
    assert read.energies == run.energies
    for name in ("positions", "velocities", "densities", "pressures"):
        for one, two in zip(getattr(read, name), getattr(run, name), strict=True):
            np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("dim", [2, 3])
def test_neighbours_are_counted_as_by_brute_force(dim):
    x = np.random.default_rng(dim).random((150, dim))
    distance = np.linalg.norm(x[:, None] - x[None], axis=-1)
    assert mean_neighbours(x, 0.21) == pytest.approx(((distance < 0.21).sum() - 150) / 150)
    assert mean_neighbours(x[:1], 0.21) == 0.0
