import numpy as np
import pytest
from problems import FALL_VELOCITY, IN_2D_ONLY, PROBLEMS, STEPPERS, THROW, around, blocks_with_levels, record

import taichi_rts as rts

every_problem = pytest.mark.parametrize("name", PROBLEMS)


LONG = ("uniform_serna", "uniform_symplectic_euler", "uniform_adaptive", "regional_graded", "asynchronous_integers")


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in STEPPERS],
)
def stepper(request):
    return request.param


@pytest.fixture(scope="module")
def runs(start_taichi, quick, on_demand, stepper):
    def run(name):
        if stepper in IN_2D_ONLY and PROBLEMS[name].scene.dim == 3:
            pytest.skip("steppers of its kind run in three dimensions")
        with start_taichi("cpu", "f64", **quick):  # anew for each, or the cache does not know the kernels again
            return record(PROBLEMS[name], STEPPERS[stepper])

    return on_demand(run)


@every_problem
def test_energy_is_never_gained(runs, stepper, name):
    energies = np.array(runs[name].energies)
    # the paper's level 3 steps beyond the acoustic limit and simmers at rest: +1.1 % here (docs/evidence/defaults.md)
    gain = 0.015 if (stepper, name) == ("regional_paper", "still_pool") else 0.01
    assert energies.max() <= (1.0 + gain) * energies[0]
    assert energies.min() > 0


@every_problem
def test_no_particle_leaves_the_domain(runs, name):
    domain = PROBLEMS[name].scene.domain
    for x, v, rho, level in runs[name].states:
        assert (x >= domain.lower).all()
        assert (x <= domain.upper).all()
        assert np.isfinite(v).all()
        assert (rho > 0).all()
        assert (level >= 1).all()


@every_problem
def test_time_is_exactly_what_was_asked_for(runs, name):
    assert all(asked == reached for asked, reached in runs[name].times)


@every_problem
def test_work_is_counted(runs, stepper, name):
    run, counts = runs[name], runs[name].statistics
    kind = STEPPERS[stepper]
    levels = kind.resolved("levels") if isinstance(kind, rts.Regional) else getattr(kind, "levels", 1)
    assert len(counts["level_fractions"]) == levels
    assert sum(counts["level_fractions"]) == pytest.approx(1.0, abs=1e-12)
    particles = len(run.states[0][0])
    assert counts["particle_updates"] == round(counts["active_fraction"] * counts["base_steps"] * particles)
    fewest = int(run.problem.end_time / run.base_step * (1 + 1e-12))
    assert counts["base_steps"] == fewest or (stepper == "uniform_adaptive" and counts["base_steps"] >= fewest)
    assert counts["active_fraction"] == 1.0 if levels == 1 else counts["active_fraction"] <= 1.0


def test_free_fall_is_exact_to_rounding(runs):
    run = runs["free_fall"]
    x0 = run.states[0][0]
    velocity, gravity = np.array(FALL_VELOCITY), np.array([0, -9.81])
    for (t, _), (x, v, _, _) in zip(run.times, run.states, strict=True):
        np.testing.assert_allclose(x, x0 + velocity * t + 0.5 * gravity * t**2, rtol=0, atol=1e-12)
        np.testing.assert_allclose(v, np.broadcast_to(velocity + gravity * t, v.shape), rtol=0, atol=1e-10)


def test_still_pool_stays_still(runs, stepper):
    x, v, rho, _ = runs["still_pool"].states[-1]
    limit = 0.1 if stepper == "regional_paper" else 0.05  # the paper's setting is known to simmer
    assert np.sqrt((v**2).sum(axis=1).mean()) < limit * np.sqrt(9.81 * 0.32)
    assert abs(x[:, 1].max() + 0.02 - 0.32) < 0.04 * 0.32
    assert rho.max() < 1.03 * 1000


def test_momentum_of_a_head_on_collision(runs, stepper):
    run = runs["head_on_blobs"]
    one_side = run.problem.scene.rest_density * 0.4 * 0.4 * 3.0
    drift = np.abs(run.momenta[-1]).max() / one_side
    assert drift < (1e-12 if stepper.startswith("uniform") else 0.08)  # partners are evaluated at different times
    x, v, _, _ = run.states[-1]
    assert np.ptp(x[:, 0]) < 0.7  # they met,
    assert np.abs(v[:, 1]).max() > 1.0  # and the fluid escapes sideways


def test_a_drop_in_flight_keeps_its_momentum(runs, stepper):
    run = runs["drop_in_flight"]
    mass = 0.4 * 0.8 * 1000.0
    drift = [
        momentum - run.momenta[0] - np.array([0, -9.81]) * time * run.momenta[0][0] / THROW[0]
        for (time, _), momentum in zip(run.times, run.momenta, strict=True)
    ]
    size = np.abs(drift).max() / (mass * 1.0)  # the halves part and meet at about 1 m/s
    assert size < (1e-12 if stepper.startswith("uniform") else 0.01)  # partners are evaluated at different times


@every_problem
def test_time_never_goes_back(runs, name):
    updated = np.array([ends[0] for ends in runs[name].ends])
    ends = np.array([sum(ends) for ends in runs[name].ends])
    assert (np.diff(updated, axis=0) >= 0).all()
    assert (ends >= updated).all()
    assert updated[-1].min() > 0  # all have come along


@every_problem
def test_cells_are_at_most_a_step_ahead_of_their_neighbours(runs, stepper, name):
    if not stepper.startswith("asynchronous"):
        pytest.skip("cells have times of their own only with asynchronous steps")
    run = runs[name]
    assert max(ahead for ahead, _ in run.cells) <= STEPPERS[stepper].levels
    youngest = [youngest for _, youngest in run.cells]
    assert (np.diff(youngest) >= 0).all()
    for (time, _), ends in zip(run.times, youngest, strict=True):
        assert ends * run.base_step > time * (1 - 1e-12)
    assert run.statistics["extrapolations"] == 0
    assert run.statistics["cells_per_pass"]["min"] >= 1


@every_problem
def test_neighbouring_blocks_obey_the_limiter(runs, stepper, name):
    if not stepper.startswith(("uniform", "regional")):
        pytest.skip(
            "cells of asynchronous steps are bounded pass by pass: tests/unit/solver/stepping/test_asynchronous_schedule.py"
        )
    graded = stepper == "regional_graded"
    for x, _, _, level in runs[name].states[1:]:
        found = blocks_with_levels(PROBLEMS[name].scene, x, level)
        slowest = {block: max(levels) for block, levels in found.items()}
        fastest = {block: min(levels) for block, levels in found.items()}
        missed = 0  # a correction may carry a particle over a face after its region was found
        for block in found:
            near = around(block, found)
            if graded:
                assert all(slowest[block] <= fastest[other] + 1 for other in near)
            # R_min: a level is that of some block nearby, around which none is slower
            missed += not any(all(slowest[k] <= slowest[block] + graded for k in around(b, found)) for b in near)
        assert missed <= 0.05 * len(found)


def test_output_times_do_not_change_the_run(start_taichi, quick, runs, stepper):
    name = "dam_break_2d"
    one_thread = stepper in ("regional_paper", "asynchronous_integers")
    options = {"cpu_max_num_threads": 1} if one_thread else {}  # nor does the number of threads
    with start_taichi("cpu", "f64", **quick, **options):
        sim = rts.Simulation(PROBLEMS[name].scene, STEPPERS[stepper])
        sim.advance_to(PROBLEMS[name].end_time)
        for once, in_pieces in zip(sim.state(), runs[name].states[-1], strict=True):
            assert once.tobytes() == in_pieces.tobytes()
        with pytest.raises(rts.TimeError, match="lies before the present"):
            sim.advance_to(0.1)
        with pytest.raises(rts.TimeError, match="not a finite time"):
            sim.advance_to(float("nan"))
        sim.advance_to(PROBLEMS[name].end_time)
        assert sim.time == PROBLEMS[name].end_time
        assert sim.statistics["base_steps"] == runs[name].statistics["base_steps"]


@pytest.mark.parametrize(
    ("name", "density"),
    [
        ("dam_break_2d", "summation"),
        pytest.param("dam_break_3d", "summation", marks=pytest.mark.slow),
        pytest.param("dam_break_2d", "continuity", marks=pytest.mark.slow),
    ],
)
def test_one_level_equals_uniform_bit_for_bit(start_taichi, name, density):
    states = []
    for same in (rts.Uniform(), rts.Regional(levels=1), rts.Asynchronous(levels=1)):
        with start_taichi("cpu", "f64"):
            sim = rts.Simulation(PROBLEMS[name].scene.replace(density=density), same)
            sim.advance_to(520.5 * sim.base_step)
            assert sim.statistics["base_steps"] == 520
            states.append(sim.state())
    for uniform, *others in zip(*states, strict=True):
        for other in others:
            assert uniform.tobytes() == other.tobytes()
