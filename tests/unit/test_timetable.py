"""Motions, hours after the start of a run: right to the rounding of where they lead, at every step; and counts beyond 32 bits."""

import math

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.assembly.inventory import parts
from taichi_rts.device import backend
from taichi_rts.device.backend import ti
from taichi_rts.device.counters import Counters
from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.solver.physics.momentum import Gravity
from taichi_rts.solver.physics.path import Path
from taichi_rts.solver.physics.timetable import Ticking, Timetable
from taichi_rts.solver.stepping.timeline import MAX_TICKS, Timeline

UNIT = rts.Box((0, 0), (1, 1))
TICK = math.pi * 2.5e-5  # [s]
ROUNDING = 2.0**-24
RUN = 500  # steps in a row
LATER = pytest.mark.parametrize(
    "begin",
    [
        pytest.param(10.0, id="10 s"),
        pytest.param(3600.0, id="an hour", marks=pytest.mark.slow),
        pytest.param(50_000.0, id="fourteen hours"),
    ],
)
NUMBERS = pytest.mark.parametrize("precision", ["f32", "f64"])


@pytest.fixture(params=["cpu", "vulkan"])
def start(request, start_taichi, quick):
    """Return a function that starts Taichi in a precision."""
    if request.param == "vulkan" and not backend.vulkan_device_types():
        pytest.skip("no Vulkan driver on this machine")

    def begin(precision="f32"):
        if (request.param, precision) == ("vulkan", "f64"):
            pytest.skip("Taichi has no sines of double precision on Vulkan")
        return start_taichi(request.param, precision, **quick)

    return begin


@ti.data_oriented
class Look:
    """Asks `what(now, tick)`, a ti.func that returns a vector, at some ticks."""

    def __init__(self, what, width, precision):
        self.what, self.width = what, width
        self.dtype = np.float32 if precision == "f32" else np.float64

    def at(self, ticks, tick):
        found = np.zeros((len(ticks), self.width), self.dtype)
        self.read(ticks.astype(np.int32), tick, found)
        return found.astype(float)

    @ti.kernel
    def read(self, ticks: ti.types.ndarray(), tick: float, found: ti.types.ndarray()):
        for k in range(ticks.shape[0]):
            value = self.what(ticks[k], tick)
            for d in ti.static(range(self.width)):
                found[k, d] = value[d]


def counted(thing, tick):
    for part in parts(thing, Ticking):
        part.count_in(tick)
    return thing


def follow(motion, precision, ticks, tick, domain=UNIT, **changes):
    """Positions that the pivot of a body and a point beside it go through, (N, 4), and the body."""
    obstacle = rts.BoxObstacle((0.4, 0.4), (0.6, 0.6), motion=motion)
    fluid = rts.Block((0, 0), (1, 0.2))
    scene = rts.Scene(domain, (fluid,), 0.05, sound_speed=50.0, obstacles=(obstacle,), **changes)
    body = bodies(scene)[0]
    path = counted(Path(body), tick)

    @ti.func
    def pose(now, tick):
        pivot, turn = path.pose(now, tick, 0.0)
        return ti.Vector([pivot[0], pivot[1], turn[0, 0], turn[1, 0]])

    return Look(pose, 4, precision).at(ticks, tick), body


@NUMBERS
@LATER
def test_a_body_goes_on_in_even_steps_however_late(start, precision, begin):
    speed, spin, last = 0.5, 3.0, 0.5
    motion = rts.Keyframes(
        (begin, begin + last), ((0, 0), (speed * last, 0)), rotations=(0, math.degrees(spin * last)), pivot=(0.4, 0.5)
    )
    first = math.ceil(begin / TICK)
    ticks = first + np.arange(-3, RUN)
    with start(precision):
        found, _ = follow(motion, precision, ticks, TICK)
    passed = np.maximum(ticks * np.longdouble(TICK) - begin, 0.0)
    travel, rounding = speed * TICK, ROUNDING if precision == "f32" else 0.0
    assert np.abs(found[:, 0] - (0.4 + speed * passed)).max() < 1e-6 * travel + 1.5 * rounding * 0.5
    assert np.abs(found[:, 2] - np.cos(spin * passed)).max() < 1e-6 * spin * TICK + 4 * rounding
    assert np.abs(found[:, 3] - np.sin(spin * passed)).max() < 1e-6 * spin * TICK + 4 * rounding
    steps = np.diff(found[:, 0])[4:]
    # Where a position of about 0.4 m can lie is rounded; before, time itself was, to 1 % of a step after 10 s.
    assert np.abs(steps / travel - 1.0).max() < 1e-6 + 2 * rounding * 0.5 / travel


@NUMBERS
@LATER
def test_a_piston_goes_on_in_even_steps_however_late(unstarted, start, precision, begin):
    speed = 0.5
    piston = rts.MovingWall("x-", (begin, begin + 0.5, begin + 1.0), (0.0, 0.25, 0.125))
    scene = rts.Scene(UNIT, (rts.Block((0, 0), (1, 0.4)),), 0.1, sound_speed=50.0, moving_walls=(piston,))
    first = math.ceil(begin / TICK)
    late = np.array([begin + 0.75, begin + 1.5])
    ticks = np.append(first + np.arange(-3, RUN), np.floor(late / TICK))
    with start(precision):
        sim = rts.Simulation(scene, rts.Uniform())
        face = counted(sim.walls[1], TICK)

        @ti.func
        def motion(now, tick):
            displacement, velocity = face.motion(now, tick)
            return ti.Vector([displacement, velocity])

        found = Look(motion, 2, precision).at(ticks, TICK)
    passed = np.maximum(ticks * np.longdouble(TICK) - begin, 0.0)
    exact = np.interp(passed.astype(float), (0.0, 0.5, 1.0), (0.0, 0.25, 0.125))
    rounding = ROUNDING if precision == "f32" else 0.0
    # As the displacement begins with 0, so does its rounding: 500 steps later it is 1e-9 m.
    assert (np.abs(found[:, 0] - exact) <= 1e-6 * speed * TICK + 4 * rounding * np.abs(exact)).all()
    assert np.abs(np.diff(found[4:-2, 0]) / (speed * TICK) - 1.0).max() < 1e-6 + 4 * rounding * RUN
    np.testing.assert_array_equal(found[[0, -2, -1], 1], [0.0, -0.25, 0.0])


@NUMBERS
def test_a_million_turns(start, precision):
    share = 1.000123e-3  # turns per tick
    spin = 2.0 * math.pi * share / TICK
    ticks = np.concatenate([np.arange(1000), 999_877_000 + np.arange(1000), MAX_TICKS - np.arange(1000)])
    with start(precision):
        found, body = follow(rts.ConstantMotion(angular_velocity=spin), precision, ticks, TICK)
    turns = ticks * (np.longdouble(spin) * np.longdouble(TICK) / (2 * np.longdouble("3.14159265358979323846")))
    assert turns.max() > 1e6
    angle = 2.0 * np.pi * (turns - np.rint(turns)).astype(float)
    limit = 8 * ROUNDING if precision == "f32" else 1e-6 * 2 * math.pi * share
    assert np.abs(found[:, 2] - np.cos(angle)).max() < limit
    assert np.abs(found[:, 3] - np.sin(angle)).max() < limit
    _, turn = body.pieces.pose(ticks[1500] * TICK)  # what the host says
    assert turn[1, 0] == pytest.approx(found[1500, 3], abs=1e-6)


def test_a_body_that_goes_round_a_periodic_domain_for_hours(start):
    ticks = np.concatenate([np.arange(RUN), int(3 * 3600.0 / TICK) + np.arange(RUN)])
    with start("f32"):
        motion = rts.ConstantMotion(velocity=(-0.7, 0))
        found, body = follow(motion, "f32", ticks, TICK, periodic=("x",))
    exact = body.pivot[0] - 0.7 * ticks * TICK
    error = found[:, 0] - exact
    assert np.abs(exact).max() > 7000.0
    assert np.abs(error - np.rint(error)).max() < 2 * ROUNDING


@pytest.mark.parametrize("dim", [2, 3])
def test_turns_about_any_axis_are_those_of_the_host(start, dim):
    still = {2: rts.Keyframes((0.1, 0.4, 0.6), rotations=(0, -800, -700))}
    still[3] = rts.Keyframes((0.1, 0.4, 0.6), rotations=((0, 0, 0), (300, -500, 90), (0, 0, 0)))
    obstacle = rts.BoxObstacle((0.4,) * dim, (0.6,) * dim, motion=still[dim])
    fluid = rts.Block((0,) * dim, (1, 0.2, 1)[:dim])
    scene = rts.Scene(rts.Box((0,) * dim, (1,) * dim), (fluid,), 0.1, sound_speed=50.0, obstacles=(obstacle,))
    times = np.linspace(0.0, 0.7, 60)
    with start("f32"):
        body = bodies(scene)[0]
        path = counted(Path(body), 1e-4)

        @ti.func
        def turn(now, tick):
            _pivot, matrix = path.pose(now, tick, 0.0)
            return ti.Vector([matrix[i, j] for i in ti.static(range(dim)) for j in ti.static(range(dim))])

        found = Look(turn, dim * dim, "f32").at(np.rint(times / 1e-4), 1e-4)
    exact = [body.pieces.pose(float(np.rint(time / 1e-4) * 1e-4))[1].ravel() for time in times]
    np.testing.assert_allclose(found, exact, atol=2e-6)


def test_gravity_changes_at_its_tick(start):
    change = rts.GravityChange(7200.0, (1.0, 2.0))
    scene = rts.Scene(UNIT, (rts.Block((0, 0), (1, 0.2)),), 0.05, sound_speed=50.0, gravity_changes=(change,))
    exactly = 7200.0 / 90_000_000
    for tick, first in ((TICK, math.ceil(7200.0 / TICK)), (exactly, 90_000_000), (1.5 * exactly, 60_000_000)):
        with start("f32"):
            gravity = counted(Gravity(scene), tick)

            @ti.func
            def pull(now, tick, gravity=gravity):
                return gravity.acceleration(ti.Vector([0.5, 0.5]), now, tick)

            found = Look(pull, 2, "f32").at(first + np.arange(-1, 2), tick)
        np.testing.assert_allclose(found[0], [0.0, -9.81])
        np.testing.assert_array_equal(found[1:], [[1.0, 2.0]] * 2)


@NUMBERS
def test_a_hundred_thousand_changes_of_gravity_are_data(start, precision):
    count, tick = 100_000, 1e-4
    times, values = np.arange(1, count + 1) * 1e-3, np.sin(np.arange(1, count + 1) * 0.01)
    changes = [rts.GravityChange(t, (v, -9.81)) for t, v in zip(times.tolist(), values.tolist(), strict=True)]
    scene = rts.Scene(UNIT, (rts.Block((0, 0), (1, 0.2)),), 0.05, sound_speed=50.0, gravity_changes=changes)
    ticks = np.array([0, 9, 10, 11, 500_015, 999_999, 1_000_000, 1_500_000])
    for interpolation, row in (("step", np.floor(ticks / 10)), ("linear", ticks / 10)):
        with start(precision):
            gravity = counted(Gravity(scene.replace(gravity_interpolation=interpolation)), tick)

            @ti.func
            def pull(now, tick, gravity=gravity):
                return gravity.acceleration(ti.Vector([0.5, 0.5]), now, tick)

            found = Look(pull, 2, precision).at(ticks, tick)
        wanted = np.interp(row, np.arange(count + 1), np.append(0.0, values))
        np.testing.assert_allclose(found[:, 0], wanted, atol=1e-12 if precision == "f64" else 2e-7)


def test_moments_that_no_run_reaches_never_come(start):
    with start("f32"):
        table = counted(Timetable([0.0, 1e9], [1e30, 1e30]), 1e-6)

        @ti.func
        def state(now, tick):
            return ti.Vector([table.piece(now, tick, 0.0), ti.cast(table.lasts(0, now, tick, 0.0), ti.i32)])

        found = Look(state, 2, "f32").at(np.array([0, MAX_TICKS, MAX_TICKS + 1024]), 1e-6)
    np.testing.assert_array_equal(found, [[0, 1]] * 3)


@pytest.mark.slow
def test_another_courant_is_another_count(taichi_cpu_f64):
    piston = rts.MovingWall("x-", (0.001, 0.2003), (0.0, 0.1))
    scene = rts.Scene(UNIT, (rts.Block((0, 0), (1, 0.3)),), 0.1, sound_speed=50.0, moving_walls=(piston,))
    sim = rts.Simulation(scene, rts.Uniform())
    table = sim.walls[1].table
    assert table.first[1] == math.floor(0.2003 / sim.timeline.tick)
    sim.solver.timeline = Timeline(0.3 * sim.timeline.tick)
    sim.schedule.begin(sim.timeline, 1)
    sim.step()
    assert table.first[1] == math.floor(0.2003 / sim.timeline.tick)
    assert table.first_rest[1] == pytest.approx(0.2003 - table.first[1] * sim.timeline.tick, abs=1e-15)


@ti.data_oriented
class Add:
    def __init__(self, counters):
        self.counters = counters

    @ti.kernel
    def run(self, times: ti.i32, count: ti.i32):
        for k in range(times):
            if ti.static(self.counters.alone):
                self.counters.add(k, count)
            else:
                self.counters.add(k % 2, count)


@pytest.mark.parametrize("alone", [True, False])
def test_counts_go_on_beyond_32_bits(start, alone):
    with start("f32"):
        counters = Counters(4, alone=alone)
        add = Add(counters)
        total = np.zeros(4, np.int64)
        for _ in range(50):
            for times, count in ((4, 2**31 - 1), (2, 1_600_000_000), (4, 3)):
                add.run(times, count)
                np.add.at(total, np.arange(times) % (4 if alone else 2), count)
        assert total[:2].min() > 2**37
        assert counters.values().tolist() == total.tolist()
        assert int(counters) == total[0]
        assert counters.take().tolist() == total.tolist()
        assert counters.values().tolist() == [0] * 4


@pytest.mark.slow
@pytest.mark.parametrize(
    "stepper",
    [rts.Regional(levels=3), rts.Regional(preset="paper"), rts.Asynchronous()],
    ids=["aligned", "paper", "asynchronous"],
)
def test_counts_of_a_run_may_pass_32_bits(taichi_cpu_f64, stepper, monkeypatch):
    monkeypatch.setattr(
        "taichi_rts.solver.stepping.aligned.MOST_HELD", 8
    )  # so that blocks hand over within a few steps
    scene = rts.Scene(UNIT, (rts.Block((0, 0), (0.4, 0.6)),), 0.1, sound_speed=50.0)
    sim = rts.Simulation(scene, stepper)
    schedule, full = sim.schedule, 2**32 - 2
    counters = [schedule.updates, *([schedule.occupancy] if isinstance(stepper, rts.Regional) else [])]
    for each in counters:
        each.low.from_numpy(np.full(each.low.shape, full, np.uint32))
    updates, begun = 0, schedule.steps
    while schedule.begin(sim.timeline, 48):
        sim.step()
        updates += int(schedule.due_count[None])
    found = schedule.updates.values() - full
    assert found.min() == 0
    assert found.sum() == updates > 48
    if isinstance(stepper, rts.Regional) and schedule.aligned:
        assert (schedule.occupancy.values() > 2**32).any()  # blocks have handed over
        schedule.count_held()
    if isinstance(stepper, rts.Regional):
        assert (schedule.occupancy.values() - full).sum() == sim.count * (sim.timeline.now - begun)
