"""Passes of the asynchronous schedule, each checked against plain NumPy on the state before and after it."""

import itertools

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.solver.stepping.criteria import MACH

POOL, JET = rts.Block((0, 0), (1, 0.5)), rts.Block((1.1, 0.1), (1.5, 0.3), velocity=(-12, 0))
SCENE = rts.Scene(domain=rts.Box((0, 0), (2, 0.8)), fluids=[POOL, JET], spacing=0.04, sound_speed=32)
STEPPERS = {
    "powers_of_two": rts.Asynchronous(courant=0.6, lambda_f=0.04),
    "integers": rts.Asynchronous(levels=12, steps="integers", lambda_f=0.02, stagger=3),
    "unlimited": rts.Asynchronous(steps="integers", levels=16, limiter=False, inactive_density="stale"),
}
PASSES = 60


def snapshot(sim):
    p, near = sim.particles, sim.near
    fields = {"x": p.x, "v": p.v, "a": p.a, "rho": p.rho, "level": p.level, "updated": p.updated, "id": p.identity}
    fields |= {"past_x": p.past_x, "past_v": p.past_v, "past_rho": p.past_rho, "past_updated": p.past_updated}
    if p.has_rho_rate:
        fields |= {"rate": p.rho_rate}
    fields |= {"near_x": near.x, "near_v": near.v, "near_rho": near.rho, "step": sim.schedule.step}
    seen = {name: field.to_numpy() for name, field in fields.items()}
    return {name: values if name == "step" else values[: sim.count] for name, values in seen.items()}


def record_pass(sim):
    """One pass with the state before and after it; None where a new cycle began, whose sort moves places."""
    schedule, seen = sim.schedule, {}
    select, update = schedule.select, sim.density.update

    def watched_select(now, tick):
        seen["before"] = snapshot(sim)
        seen["time"] = schedule.time.to_numpy()
        seen["youngest"] = int(schedule.youngest[None])
        select(now, tick)

    def watched_update(*due):
        seen["read"] = snapshot(sim)  # what neighbours read, before the due have a new density
        update(*due)

    wake = schedule.wake_neighbours

    def watched_wake(now):
        seen["assigned"] = schedule.step.to_numpy()
        wake(now)

    schedule.select, sim.density.update, schedule.wake_neighbours = watched_select, watched_update, watched_wake
    assert schedule.begin(sim.timeline, 1 << 29)
    seen["sorted"] = schedule.needs_sorting
    sim.step()
    schedule.select, sim.density.update, schedule.wake_neighbours = select, update, wake
    seen["order"] = sim.grid.order.to_numpy()
    seen["block"] = sim.grid.cell_of.to_numpy() // CELLS_PER_BLOCK  # of each particle
    seen["due"] = seen["order"][schedule.due.to_numpy()[: schedule.due_count[None]]]
    seen["read_at"] = schedule.read_at.to_numpy()
    return seen | {"now": sim.timeline.now, "cycle_end": schedule.cycle_end, "after": snapshot(sim)}


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=[] if name == "powers_of_two" else pytest.mark.slow) for name in STEPPERS],
)
def recorded(request, start_taichi, quick):
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(SCENE, STEPPERS[request.param], debug=True)
        sim.advance_to(0.012)
        yield sim, [record_pass(sim) for _ in range(PASSES)]


def lowest_around(sim, values, fill):
    around = np.full_like(values, fill)
    for stride in sim.grid.geometry.neighbour_strides:
        around = np.minimum(around, np.roll(values, -stride))
    return around


def ends(state):
    return state["updated"] + state["level"]


def test_a_cell_has_the_time_of_its_youngest_particle(recorded):
    sim, passes = recorded
    for one in passes:
        expected = np.full(sim.grid.geometry.blocks, sim.schedule.EMPTY)
        np.minimum.at(expected, one["block"], ends(one["before"]))
        assert one["time"].tolist() == expected.tolist()
        assert one["youngest"] == expected.min()
    assert (np.diff([one["youngest"] for one in passes]) >= 0).all()


def test_only_cells_without_a_younger_neighbour_step(recorded):
    sim, passes = recorded
    several_times = ended_early = 0
    for one in passes:
        blocks = np.unique(one["block"][one["due"]])
        times = one["time"][blocks]
        assert (times <= lowest_around(sim, one["time"], sim.schedule.EMPTY)[blocks]).all()
        assert (times < one["cycle_end"]).all()
        assert one["youngest"] in times  # so there is progress in every pass
        several_times += len(set(times)) > 1
        younger = one["before"]["updated"] < one["time"][one["block"]]
        assert sorted(np.flatnonzero(np.isin(one["block"], blocks) & younger)) == sorted(one["due"])
        ended_early += np.count_nonzero(ends(one["before"])[one["due"]] > one["time"][one["block"][one["due"]]])
        assert (one["before"]["updated"][one["due"]] <= one["youngest"]).all()
    assert several_times > 0 or sim.stepper.steps == "powers_of_two"
    assert ended_early > 0 or sim.stepper.steps == "powers_of_two"  # all of a cell move to one new time, newcomers too


def test_particles_that_are_read_are_interpolated_to_the_readers_time(recorded):
    sim, passes = recorded
    past = 0
    for one in passes:
        old, tick = one["before"], sim.timeline.tick
        read = one["read_at"][one["block"]] >= 0
        time = one["now"] + one["read_at"][one["block"]]
        stepping = np.zeros(sim.grid.geometry.blocks, dtype=bool)
        stepping[one["block"][one["due"]]] = True
        near = stepping.copy()
        for stride in sim.grid.geometry.neighbour_strides:
            near |= np.roll(stepping, -stride)
        assert (read == near[one["block"]]).all()  # no other block is touched
        assert (time <= ends(old))[read].all()
        dt = ((time - old["updated"]) * tick)[:, None]
        x = old["x"] + old["v"] * dt + 0.5 * old["a"] * dt**2
        v = old["v"] + old["a"] * dt
        rho = old["rho"] + (old["rate"] * dt[:, 0] if "rate" in old else 0.0)
        back = read & (time < old["updated"])
        if back.any():
            assert (time >= old["past_updated"])[back].all()
            h = ((old["updated"] - old["past_updated"]) * tick)[back, None]
            s = 1.0 + dt[back] / h
            ends_x = (1 + 2 * s) * (1 - s) ** 2 * old["past_x"][back] + s**2 * (3 - 2 * s) * old["x"][back]
            slopes = s * (1 - s) ** 2 * h * old["past_v"][back] - s**2 * (1 - s) * h * old["v"][back]
            x[back] = ends_x + slopes
            v[back] = (1 - s) * old["past_v"][back] + s * old["v"][back]
            rho[back] = ((1 - s) * old["past_rho"][back, None] + s * old["rho"][back, None])[:, 0]
            past += np.count_nonzero(back)
        place = np.argsort(one["order"])[read]  # of each particle in the grid's order
        x = np.clip(x, SCENE.domain.lower, SCENE.domain.upper)
        np.testing.assert_allclose(one["read"]["near_x"][place], x[read], rtol=0, atol=1e-13)
        np.testing.assert_allclose(one["read"]["near_v"][place], v[read], rtol=0, atol=1e-11)
        np.testing.assert_allclose(one["read"]["near_rho"][place], rho[read], rtol=1e-13)


def test_the_due_move_to_their_cells_time_and_the_others_stay(recorded):
    _, passes = recorded
    for one in passes:
        old, new, due = one["before"], one["after"], one["due"]
        assert (new["updated"][due] == one["time"][one["block"][due]]).all()
        for name in ("x", "v", "updated"):
            assert (new[f"past_{name}"][due] == old[name][due]).all()
        assert (new["past_rho"][due] == old["rho"][due]).all()
        idle = np.setdiff1d(one["order"], due)
        for name in ("x", "v", "a", "rho", "updated", "past_x", "past_updated"):
            assert (new[name][idle] == old[name][idle]).all()
        assert (new["level"][idle] <= old["level"][idle]).all()  # a step may only be ended earlier


def test_steps_obey_the_cells_limits(recorded):
    sim, passes = recorded
    stepper, tick, support, c = sim.stepper, sim.timeline.tick, SCENE.support, SCENE.wave_speed
    taken, compressed = set(), 0
    for one in passes:
        new = one["after"]
        for block in np.unique(one["block"][one["due"]]):
            inside = one["block"] == block
            due = np.intersect1d(np.flatnonzero(inside), one["due"])
            time = new["updated"][due[0]]
            dt = ((time - new["updated"][inside]) * tick)[:, None]
            speed = np.linalg.norm(new["v"][inside] + new["a"][inside] * dt, axis=1).max()
            force = np.linalg.norm(new["a"][inside], axis=1).max()
            allowed = [stepper.lambda_f * np.sqrt(support / force) / tick, stepper.levels]
            stiffening = max(1.0, (new["rho"][inside].max() / SCENE.rest_density) ** 3 - MACH)
            if speed > MACH * c or stiffening > 1.0:
                signal = stiffening * c + max(speed, MACH * c)
                allowed.append((1 + MACH) * stepper.longest_courant * support / signal / tick)
                compressed += stiffening > 1.0
            step = new["level"][due]
            assert step.max() <= max(1, np.floor(min(allowed) * (1 + 1e-9)))
            assert step.min() >= 1
            taken |= set(step)
            if stepper.steps == "powers_of_two":
                assert time % step.max() == 0
            before = one["before"]["step"][block]
            if stepper.limiter:
                assert step.max() <= 2 * before
    assert len(taken) >= 3
    assert compressed > 0


def test_neighbours_are_limited_and_woken(recorded):
    sim, passes = recorded
    woken = 0
    for one in passes:
        old, new = one["before"], one["after"]
        steps = np.full(sim.grid.geometry.blocks, sim.schedule.EMPTY)
        stepped = np.unique(one["block"][one["due"]])
        steps[stepped] = one["assigned"][stepped]
        shortest = np.minimum(steps, lowest_around(sim, steps, sim.schedule.EMPTY))[one["block"]]
        beside = (shortest < sim.schedule.EMPTY) & (one["read_at"][one["block"]] >= 0)
        present = one["now"] + one["read_at"][one["block"]]
        idle = np.setdiff1d(np.flatnonzero(beside), one["due"])
        if sim.stepper.limiter:
            latest = np.maximum(present, new["updated"] + 2 * shortest)
            assert (ends(new) <= latest)[beside].all()
            expected = np.minimum(ends(old), np.maximum(present, old["updated"] + 2 * shortest))
            assert (ends(new)[idle] == expected[idle]).all()
            woken += np.count_nonzero(ends(new)[idle] < ends(old)[idle])
            assert (ends(new)[idle] >= present[idle]).all()
        else:
            assert (ends(new)[idle] == ends(old)[idle]).all()
    assert (woken > 0) == sim.stepper.limiter


def test_a_new_cycle_moves_no_particle_in_time(recorded):
    """A particle that crosses into a cell of another time keeps its own; none is lost, doubled or evaluated by the sort."""
    sim, passes = recorded
    crossed, mixed = 0, 0
    for last, one in itertools.pairwise(passes):
        before, after = last["after"], one["before"]
        a, b = np.argsort(before["id"]), np.argsort(after["id"])
        assert (after["id"][b] == np.arange(sim.count)).all()
        for name in ("x", "v", "a", "updated", "level", "past_x", "past_updated"):
            assert (before[name][a] == after[name][b]).all()
        crossed += np.count_nonzero(last["block"][a] != one["block"][b])
        youngest = one["time"][one["block"]]
        mixed += np.count_nonzero(ends(after) > youngest)
        if one["sorted"]:
            assert (after["updated"] < one["now"]).all()  # so that all are inside their steps at the time of the sort
            assert (ends(after) >= one["now"]).all()
    assert crossed > 0
    assert mixed > 0 or sim.stepper.steps == "powers_of_two"


def test_a_particle_that_drifts_too_far_ends_the_cycle(recorded):
    """No pair within the support radius is missed: no particle leaves the place it was sorted in by more than the drift."""
    sim, passes = recorded
    geometry = sim.grid.geometry
    assert min(geometry.sides) >= SCENE.support + 2 * geometry.drift
    start = None
    for one in passes:
        state = one["before"]
        if one["sorted"]:
            dt = ((one["now"] - state["updated"]) * sim.timeline.tick)[:, None]
            start = (state["id"], state["x"] + state["v"] * dt + 0.5 * state["a"] * dt**2)
        elif start is None:
            continue
        present = one["now"] + one["read_at"][one["block"]]
        dt = ((present - state["updated"]) * sim.timeline.tick)[:, None]
        x = (state["x"] + state["v"] * dt + 0.5 * state["a"] * dt**2)[np.argsort(state["id"])]
        moved = np.linalg.norm(x - start[1][np.argsort(start[0])], axis=1)
        read = (one["read_at"][one["block"]] >= 0)[np.argsort(state["id"])]
        assert moved[read].max() <= geometry.drift * 1.05


def test_counts_add_up(recorded):
    sim, passes = recorded
    _, updates = sim.schedule.take_counts()
    assert sum(updates) == sum(len(one["due"]) for one in passes)
    widths = sim.schedule.seen_widths[-1][-PASSES:]
    assert widths.tolist() == [len(np.unique(one["block"][one["due"]])) for one in passes]
    assert sim.statistics["extrapolations"] == 0


def test_errors_name_the_remedy():
    with pytest.raises(rts.StepperError, match="levels 12 is no power of two; use 8 or 16, or steps='integers'"):
        rts.Asynchronous(levels=12)
    with pytest.raises(rts.StepperError, match="levels"):
        rts.Asynchronous(levels=0)
