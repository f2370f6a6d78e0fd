import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.solver.stepping.limiter import EMPTY

POOL, JET = rts.Block((0, 0), (1, 0.5)), rts.Block((1.5, 0.1), (1.8, 0.3), velocity=(-9, 0))
SCENE = rts.Scene(domain=rts.Box((0, 0), (2, 0.8)), fluids=[POOL, JET], spacing=0.04, sound_speed=32)
STEPPER = rts.Regional(preset="paper", inactive_density="extrapolated")


def snapshot(sim):
    p, near = sim.particles, sim.near
    fields = {"x": p.x, "v": p.v, "a": p.a, "rho": p.rho, "rate": p.rho_rate, "level": p.level, "updated": p.updated}
    seen = {"near_x": near.x, "near_v": near.v, "near_rho": near.rho, "near_p": near.p_over_rho2}
    return {name: field.to_numpy()[: sim.count] for name, field in (fields | seen).items()}


def record_step(sim):
    """One step of Algorithm 1, with the state before it, and all that the schedule decided."""
    schedule, seen = sim.schedule, {}
    select = schedule.select

    def watched(now, tick):
        seen["before"] = snapshot(sim)
        select(now, tick)
        seen["due"] = schedule.due.to_numpy()[: schedule.due_count[None]]
        for name in ("raw_level", "block_level", "read_at"):
            seen[name] = getattr(schedule, name).to_numpy()
        seen["order"] = sim.grid.order.to_numpy()
        seen["block"] = sim.grid.cell_of.to_numpy()[seen["order"]] // CELLS_PER_BLOCK

    schedule.select = watched
    sim.timeline.now += 1
    sim.step()
    schedule.select = select
    return seen | {"after": snapshot(sim), "now": sim.timeline.now}


@pytest.fixture(scope="module")
def recorded(start_taichi, quick):
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(SCENE, STEPPER)
        sim.advance_to(0.06)
        yield sim, [record_step(sim) for _ in range(8)]


def lowest_around(sim, values, fill):
    around = np.full_like(values, fill)
    for stride in sim.grid.geometry.neighbour_strides:
        around = np.minimum(around, np.roll(values, -stride))
    return around


def test_levels_follow_eq_2_and_3_from_block_maxima(recorded):
    sim, steps = recorded
    stepper, support, tick = sim.stepper, SCENE.support, sim.base_step
    lambda_f = stepper.resolved("lambda_f")
    met = set()
    for step in steps:
        old = step["before"]
        v = old["v"] + old["a"] * ((step["now"] - old["updated"]) * tick)[:, None]
        blocks = sim.grid.geometry.blocks
        speed, force, expected = np.zeros(blocks), np.zeros(blocks), np.full(blocks, EMPTY)
        np.maximum.at(speed, step["block"], np.linalg.norm(v, axis=1)[step["order"]])
        np.maximum.at(force, step["block"], np.linalg.norm(old["a"], axis=1)[step["order"]])
        expected[step["block"]] = 1
        for n in range(2, stepper.resolved("levels") + 1):
            beta = stepper.beta * stepper.resolved("beta_decay") ** (n - 2)
            with np.errstate(divide="ignore"):
                eq_2 = n * tick <= lambda_f * np.sqrt(support / force)
            eq_3 = n * tick * speed / support <= stepper.alpha * beta
            expected[(expected != EMPTY) & eq_2 & eq_3] = n
        assert step["raw_level"].tolist() == expected.tolist()
        met |= set(expected) - {EMPTY}
    assert {1, 2} <= met


@pytest.mark.slow
def test_compressed_blocks_step_as_far_as_their_sound_allows(recorded):
    levels = {}
    for local_sound in (True, False):
        scene = SCENE.replace(fluids=[POOL], gravity=(0, -1e-6))
        sim = rts.Simulation(scene, rts.Regional(levels=3, limiter=False, local_sound=local_sound))
        left = sim.particles.x.to_numpy()[:, 0] < 0.5
        sim.particles.rho.from_numpy(np.where(left, 1.3, 1.02) * scene.rest_density)
        sim.particles.a.fill(0.0)
        sim.schedule.select(1, sim.base_step)
        levels[local_sound] = sim.schedule.raw_level.to_numpy()
        hit = np.unique(sim.grid.cell_of.to_numpy()[left] // CELLS_PER_BLOCK)
    assert set(levels[False]) == {3, EMPTY}
    assert set(levels[True][hit]) == {1}  # 3 / (1.3^3 - 0.1) base steps of the 3 that c_s allows
    assert set(np.delete(levels[True], hit)) == {3, EMPTY}


def test_no_block_misses_the_minimum_region(recorded):
    sim, steps = recorded
    for step in steps:
        raw = step["raw_level"]
        expected = np.where(raw == EMPTY, EMPTY, np.minimum(raw, lowest_around(sim, raw, EMPTY)))
        assert step["block_level"].tolist() == expected.tolist()


def test_due_are_the_expired_and_those_whose_step_changed(recorded):
    _, steps = recorded
    waiting = 0
    for step in steps:
        old, order = step["before"], step["order"]
        level = step["block_level"][step["block"]]
        expired = old["level"][order] <= step["now"] - old["updated"][order]
        due = expired | (old["level"][order] != level)
        assert step["due"].tolist() == np.flatnonzero(due).tolist()
        new = step["after"]
        assert (new["updated"][order[due]] == step["now"]).all()
        assert (new["level"][order] == level).all()
        waiting += np.count_nonzero(~due)
    assert waiting > 0


def test_particles_that_are_not_due_keep_their_state(recorded):
    _, steps = recorded
    for step in steps:
        idle = np.setdiff1d(step["order"], step["order"][step["due"]])
        for name in ("x", "v", "a", "rho", "rate", "level", "updated"):
            assert (step["after"][name][idle] == step["before"][name][idle]).all()


def test_blocks_without_due_neighbours_are_not_touched_at_all(recorded):
    sim, steps = recorded
    spared = 0
    for step in steps:
        idle_block = np.ones(sim.grid.geometry.blocks, dtype=np.int32)
        idle_block[step["block"][step["due"]]] = 0
        spare = np.minimum(idle_block, lowest_around(sim, idle_block, 1))[step["block"]] == 1
        assert ((step["read_at"][step["block"]] == 0) == ~spare).all()
        for name in ("near_x", "near_v", "near_rho", "near_p"):
            assert (step["after"][name][spare] == step["before"][name][spare]).all()
        spared += np.count_nonzero(spare)
    assert spared > 0


def test_particles_that_are_read_were_predicted_to_the_present(recorded):
    sim, steps = recorded
    for step in steps:
        old, order = step["before"], step["order"]
        dt = ((step["now"] - old["updated"]) * sim.base_step)[order, None]
        predicted = old["x"][order] + old["v"][order] * dt + 0.5 * old["a"][order] * dt**2
        predicted = np.clip(predicted, SCENE.domain.lower, SCENE.domain.upper)
        touched = step["read_at"][step["block"]] == 0
        np.testing.assert_allclose(step["after"]["near_x"][touched], predicted[touched], rtol=0, atol=1e-14)
        idle = touched.copy()
        idle[step["due"]] = False
        rho = old["rho"][order] + old["rate"][order] * dt[:, 0]
        np.testing.assert_allclose(step["after"]["near_rho"][idle], rho[idle], rtol=1e-14)


def test_counts_add_up(recorded):
    sim, steps = recorded
    occupancy, updates = sim.schedule.take_counts()
    assert sum(occupancy) == len(steps) * sim.count
    assert sum(updates) == sum(len(step["due"]) for step in steps)
