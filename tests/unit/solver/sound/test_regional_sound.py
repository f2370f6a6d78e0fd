"""The regional sound speed: its description, what a scene makes of it, the floating reference and the rule."""

import math

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.device.backend import ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.scene.loading import scene_from
from taichi_rts.solver.sound.rule import SLACK
from taichi_rts.solver.stepping.settled import lengths

G, S, R = 9.81, 0.05, 0.1
REST = 1000.0
FLOOR, CAP = 4.0, 100.0
SOUND = rts.RegionalSound(floor=FLOOR, cap=CAP)


def tank(*fluids, **changes):
    fields = {"domain": rts.Box((0, 0), (2, 2)), "fluids": fluids, "spacing": S, "sound_speed": "regional"}
    return rts.Scene(**(fields | changes))


def pressure(rho, sound, reference):
    return REST * sound**2 / 7.0 * ((rho / reference) ** 7 - 1.0)


# -- the description ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("regionl", ["sound_speed: Input should be 'regional' or 'auto' (got 'regionl')"]),
        (-3.0, ["sound_speed: Input should be greater than 0 (got -3.0)"]),
        ({"mach": -0.1}, ["sound_speed.mach: Input should be greater than 0 (got -0.1)"]),
        ({"floor": 0.0}, ["sound_speed.floor: Input should be greater than 0 (got 0.0)"]),
        ({"cap": math.inf}, ["sound_speed.cap: Input should be a finite number"]),
        ({"memory": 0}, ["sound_speed.memory: Input should be greater than 0"]),
        ({"mack": 0.1}, ["sound_speed.mack: unknown key; did you mean 'mach'?"]),
        ({"floor": 50.0, "cap": 20.0}, ["sound_speed: floor 50 exceeds cap 20; lower it, or raise the cap"]),
    ],
)
def test_a_mistake_is_one_clear_line(given, words):
    data = {"domain": {"lower": [0, 0], "upper": [1, 1]}, "fluids": [{"lower": [0, 0], "upper": [1, 1]}], "spacing": S}
    with pytest.raises(rts.SceneError) as raised:
        scene_from(data | {"sound_speed": given})
    for word in words:
        assert word in str(raised.value)
    assert len(str(raised.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"density": "continuity"}, ["density 'continuity'", "use density 'summation'"]),
        ({"background_pressure": 5e3}, ["knows no background_pressure, which is 5000 [Pa]", "set that to 0"]),
        ({"gravity": (0, 0)}, ["nothing falls or moves", "give it a value [m/s]"]),
        ({"body_force": rts.LinearField(((1, 0), (0, 1)))}, ["give ten times the largest speed you expect [m/s]"]),
    ],
)
def test_what_it_does_not_go_with(changes, words):
    tank(rts.Block((0, 0), (1, 1)), **(changes | {"sound_speed": 9.0}))
    for sound in ("regional", SOUND):
        with pytest.raises(rts.SceneError) as raised:
            tank(rts.Block((0, 0), (1, 1)), **(changes | {"sound_speed": sound}))
        for word in words:
            assert word in str(raised.value)


def test_it_survives_being_written_down():
    scene = tank(rts.Block((0, 0), (1, 1)), sound_speed=SOUND)
    assert scene_from(scene.to_dict()) == scene
    assert scene.replace(sound_speed="regional").regional_sound == rts.RegionalSound()
    assert scene.replace(sound_speed=30).regional_sound is None
    assert scene.replace(sound_speed=None).regional_sound is None


# -- what a scene makes of it ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fluids", "changes", "depth"),
    [
        ([rts.Block((0, 0), (2, 0.5))], {}, 0.5 * G),
        ([rts.Block((0, 0), (2, 0.5)), rts.Block((0.5, 1), (1, 1.3))], {}, 0.8 * G),  # one will lie on the other
        ([rts.Block((0, 0), (1, 0.5)), rts.Block((1, 0), (2, 0.3))], {}, 0.5 * G),  # beside, though they touch
        ([rts.Block((0, 0), (1, 0.5)), rts.Block((0.9, 0.6), (2, 1)), rts.Block((1.5, 1), (2, 1.2))], {}, 1.1 * G),
        ([rts.Block((0, 0), (2, 0.5))], {"gravity": (0, -2)}, 1.0),
        ([rts.Block((0, 0), (2, 0.5))], {"gravity": (0, 2)}, 1.0),
        ([rts.Block((0, 0), (2, 0.5))], {"gravity_changes": [rts.GravityChange(1.0, (3, 0))]}, 6.0),
        ([rts.Sphere((1, 1), 0.25)], {}, 0.5 * G),
    ],
)
def test_depth_is_that_of_what_stands_on_each_other(fluids, changes, depth):
    assert tank(*fluids, **changes).depth_potential == pytest.approx(depth)


def test_sound_speeds_of_a_scene():
    scene = tank(rts.Block((0, 0), (1, 0.5)))
    fastest, still = math.sqrt(2 * G * 0.5), 6.8 * math.sqrt(G * 0.5)
    assert scene.wave_speed == pytest.approx(20 * fastest)
    assert scene.least_wave_speed == pytest.approx(still)
    assert scene.viscous_wave_speed == pytest.approx(10 * fastest)

    coarse = scene.replace(sound_speed=rts.RegionalSound(mach=0.2))
    assert coarse.wave_speed == pytest.approx(10 * fastest)
    assert coarse.viscous_wave_speed == pytest.approx(10 * fastest)

    given = scene.replace(sound_speed=SOUND)
    assert (given.wave_speed, given.least_wave_speed) == (CAP, FLOOR)
    wide = scene.replace(sound_speed=rts.RegionalSound(floor=1.0, cap=96.0))
    assert wide.least_wave_speed == pytest.approx(3.0)  # 1/32 of the cap
    low = scene.replace(sound_speed=rts.RegionalSound(cap=5.0))
    assert (low.wave_speed, low.least_wave_speed) == (5.0, 5.0)  # the floor of the depth lies above

    same = scene.replace(sound_speed=7.0)
    assert (same.wave_speed, same.least_wave_speed, same.viscous_wave_speed) == (7.0, 7.0, 7.0)


# -- steps ----------------------------------------------------------------------------------------------------------


def test_lengths_of_steps():
    assert lengths("half_octaves", 32) == [1, 2, 3, 4, 6, 8, 12, 16, 24, 32]
    assert lengths("half_octaves", 7) == [1, 2, 3, 4, 6]
    assert lengths("powers_of_two", 20) == [1, 2, 4, 8, 16]
    assert lengths("integers", 5) == [1, 2, 3, 4, 5]
    assert lengths("half_octaves", 1) == [1]


def test_the_paper_has_one_sound_speed():
    scene = tank(rts.Block((0, 0), (1, 0.5)))
    for build in ("timeline", "in_scene"):
        with pytest.raises(
            rts.StepperError, match=r"preset 'paper' is for one sound speed.*give the scene a sound_speed"
        ):
            getattr(rts.Regional(preset="paper"), build)(scene)
    rts.Regional(preset="paper").timeline(scene.replace(sound_speed=30.0))


@pytest.mark.parametrize(("steps", "levels"), [(None, 25), ("integers", 25), ("powers_of_two", 16)])
def test_levels_reach_from_the_cap_to_the_floor(steps, levels):
    scene = tank(rts.Block((0, 0), (1, 0.5)), sound_speed=SOUND)
    full = rts.Regional(steps=steps).in_scene(scene)
    assert (full.levels, full.courant, full.limiter) == (levels, 0.4, True)
    assert full.lengths == tuple(lengths(steps or "half_octaves", levels))
    assert full.aligned
    assert rts.Regional().timeline(scene).tick == pytest.approx(0.4 * R / CAP)
    assert rts.Regional(levels=4).in_scene(scene).levels == 4


# -- on the device: a strip of 16 x 2 blocks, in which one is fast ----------------------------------------------------


@pytest.fixture(scope="module")
def sim(start_taichi, quick):
    water = rts.Block((0, 0), (1.6, 0.2), velocity=(1, 0))
    scene = tank(water, domain=rts.Box((0, 0), (1.6, 0.4)), gravity=(0, 0), sound_speed=SOUND)
    with start_taichi("cpu", "f64", **quick):
        yield rts.Simulation(scene, rts.Uniform())


@pytest.fixture
def strip(sim):
    """The simulation with all at rest, and for each particle the place of its block along x."""
    p = sim.particles
    p.v.fill(0.0)
    p.a.fill(0.0)
    p.rho.fill(REST)
    p.reference.fill(REST)
    p.sound.fill(FLOOR)
    for field in (sim.sound.target, sim.sound.wish, sim.sound.limit):
        field.fill(0.0)
    blocks = sim.grid.cell_of.to_numpy() // CELLS_PER_BLOCK
    return sim, blocks, np.floor(p.x.to_numpy()[:, 0] / R).astype(int)


def along(sim, blocks, places, field):
    """Values of a field of blocks by place along x: the least and the largest of the two above each other."""
    values = field.to_numpy()
    return np.array([[f(values[blocks[places == k]]) for f in (np.min, np.max)] for k in range(16)]).T


def test_a_fast_block_stiffens_those_around_it_and_by_halves_those_beyond(strip):
    sim, blocks, places = strip
    sim.particles.v.from_numpy(np.where(places == 4, 8.0, 0.0)[:, None] * np.array([0.6, 0.8]))
    assert np.count_nonzero(places == 4) == 8
    seen = []
    for _ in range(6):
        sim.sound.update(sim.schedule.read_at, 0, sim.timeline.tick)
        low, high = along(sim, blocks, places, sim.sound.target)
        assert low == pytest.approx(high)
        seen.append(low)
    around = [80.0, 80.0, 40.0, 20.0, 10.0, 5.0, FLOOR, FLOOR]  # |v| / mach = 80 m/s, then halves, then the floor
    assert seen[-1][4:12] == pytest.approx(around)
    assert seen[-1][3::-1] == pytest.approx(around[1:5])
    assert seen[-1][12:] == pytest.approx(FLOOR)
    assert seen[0][4:8] == pytest.approx([80, 80, FLOOR, FLOOR])  # what is said of neighbours takes a block a call
    assert seen[1][4:8] == pytest.approx([80, 80, 40, FLOOR])
    own, wish = (along(sim, blocks, places, field)[0] for field in (sim.sound.own, sim.sound.wish))
    assert own == pytest.approx(FLOOR)
    assert wish == pytest.approx(np.where(np.arange(16) == 4, 80, FLOOR))
    empty = np.setdiff1d(np.arange(len(sim.sound.target.to_numpy())), blocks)
    assert (sim.sound.target.to_numpy()[empty] == 0.0).all()


@pytest.mark.parametrize(("speed", "wish"), [(50.0, CAP), (0.3, FLOOR), (5.0, 50.0)])
def test_cap_and_floor_hold(strip, speed, wish):
    sim, blocks, places = strip
    sim.particles.v.from_numpy(np.where(places == 4, speed, 0.0)[:, None] * np.array([1.0, 0.0]))
    sim.sound.update(sim.schedule.read_at, 0, sim.timeline.tick)
    target = along(sim, blocks, places, sim.sound.target)[1]
    assert target[3:6] == pytest.approx(wish)
    assert target.min() == pytest.approx(FLOOR)
    ceiling = along(sim, blocks, places, sim.sound.ceiling)[1]
    assert ceiling == pytest.approx(target)  # what speed asks for has no slack


def test_speeds_are_those_of_the_present(strip):
    sim, blocks, places = strip
    sim.particles.a.from_numpy(np.where(places == 4, 30.0, 0.0)[:, None] * np.array([1.0, 0.0]))
    tick = sim.timeline.tick
    now = round(0.1 / tick)
    updated = sim.particles.updated.to_numpy()
    assert not updated.any()
    sim.sound.update(sim.schedule.read_at, now, tick)
    assert along(sim, blocks, places, sim.sound.target)[1][4] == pytest.approx(300 * now * tick)


def test_a_block_under_pressure_needs_sound_though_it_is_still(strip):
    sim, blocks, places = strip
    p, squeezed = sim.particles, places == 4
    lower = squeezed & (p.x.to_numpy()[:, 1] < R)
    half = np.flatnonzero(lower)[:2]  # of its four particles
    p.sound.fill(20.0)
    rho = np.full(sim.count, REST)
    rho[half] = 1050.0
    p.rho.from_numpy(rho)
    sim.sound.update(sim.schedule.read_at, 0, sim.timeline.tick)
    mean = 0.5 * pressure(1050.0, 20.0, REST)
    expected = math.sqrt(mean / REST) / 0.1
    assert 2 * FLOOR < expected < CAP
    block = blocks[half[0]]
    assert sim.sound.wish.to_numpy()[block] == pytest.approx(expected)
    assert sim.sound.ceiling.to_numpy()[block] == pytest.approx(SLACK * expected)
    assert sim.sound.own.to_numpy()[block] == pytest.approx(20.0 * (1.05**3 - 0.1))
    assert sim.sound.limit.to_numpy()[block] == pytest.approx(max(expected, 20.0 * (1.05**3 - 0.1)))
    rho[half] = 900.0  # has no pull on others, and so requires nothing
    p.rho.from_numpy(rho)
    sim.sound.update(sim.schedule.read_at, 0, sim.timeline.tick)
    assert sim.sound.wish.to_numpy()[block] == pytest.approx(FLOOR)


# -- the floating reference -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def adapt(sim):
    """Adapt particles of given sound speed, reference and density in a block of one target; return what they have then."""
    law, p = sim.medium.equation_of_state, sim.particles

    @ti.kernel
    def run(count: int, elapsed: float):
        for i in range(count):
            law.adapt(i, 0, p.rho[i], elapsed)

    def adapted(sound, reference, rho, wanted, elapsed, ceiling=None):
        some = len(rho)
        for field, values in ((p.sound, sound), (p.reference, reference), (p.rho, rho)):
            whole = field.to_numpy()
            whole[:some] = values
            field.from_numpy(whole)
        sim.sound.target[0] = wanted
        sim.sound.ceiling[0] = wanted if ceiling is None else ceiling
        run(some, elapsed)
        return p.sound.to_numpy()[:some], p.reference.to_numpy()[:some]

    return adapted


RHO = np.array([1000.5, 1003.0, 1010.0, 1050.0, 1200.0])
REFERENCE = np.array([1000.0, 999.0, 1002.0, 980.0, 1010.0])


def test_the_pressure_stays_when_the_target_rises(adapt):
    sound, reference = adapt(10.0, REFERENCE, RHO, wanted=100.0, elapsed=0.0)
    assert (sound == 100.0).all()  # at once
    before = pressure(RHO, 10.0, REFERENCE)
    assert before.min() > 0.0
    assert pressure(RHO, sound, reference) == pytest.approx(before, rel=1e-9)
    assert (np.abs(RHO / reference - 1.0) < 0.1 * np.abs(RHO / REFERENCE - 1.0)).all()  # stiffer, so less compressed


def test_the_pressure_stays_when_the_sound_speed_falls(adapt):
    elapsed = 0.004
    sound, reference = adapt(50.0, REFERENCE, RHO, wanted=5.0, elapsed=elapsed)
    memory = 40.0 * R
    assert sound == pytest.approx(1.0 / (1.0 / 50.0 + elapsed / memory))
    share = sound * elapsed / memory
    assert 0.01 < share[0] < 0.1
    moved = (reference - share * REST) / (1.0 - share)  # before it relaxed
    assert pressure(RHO, sound, moved) == pytest.approx(pressure(RHO, 50.0, REFERENCE), rel=1e-9)


def test_the_sound_speed_falls_no_lower_than_the_ceiling(adapt):
    sound, _ = adapt(50.0, REFERENCE, RHO, wanted=24.9, ceiling=49.8, elapsed=0.1)
    assert (sound == 49.8).all()
    sound, _ = adapt(50.0, REFERENCE, RHO, wanted=30.0, ceiling=60.0, elapsed=0.1)
    assert (sound == 50.0).all()


def test_the_reference_stays_where_the_pressure_is_cut_off(adapt):
    rho = np.array([300.0, 900.0, 979.9])
    reference = np.array([1000.0, 980.0, 980.0])
    for before, wanted in ((10.0, 100.0), (100.0, 10.0)):
        sound, after = adapt(before, reference, rho, wanted=wanted, elapsed=0.0)
        assert (after == reference).all()
        assert (sound == max(before, wanted)).all()


@pytest.mark.parametrize(("elapsed", "share"), [(0.008, 0.02), (0.4, 1.0), (1.0, 1.0)])
def test_the_reference_relaxes_to_rest(adapt, elapsed, share):
    reference = np.array([900.0, 990.0, 1100.0])
    sound, after = adapt(10.0, reference, np.array([300.0, 500.0, 1099.0]), wanted=10.0, elapsed=elapsed)
    assert (sound == 10.0).all()
    assert after == pytest.approx(reference + share * (REST - reference), rel=1e-12)  # c dt / (40 r)


# -- a whole run --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_with_one_sound_speed_it_is_the_run_without(start_taichi, quick):
    dam = tank(rts.Block((0, 0), (0.6, 0.6)), domain=rts.Box((0, 0), (1, 1)), sound_speed=None)
    c = dam.wave_speed
    states = []
    for sound in (c, rts.RegionalSound(floor=c, cap=c)):
        scene = dam.replace(sound_speed=sound)
        assert scene.wave_speed == scene.least_wave_speed == scene.viscous_wave_speed == pytest.approx(c)
        with start_taichi("cpu", "f64", **quick):
            run = rts.Simulation(scene, rts.Uniform())
            run.advance_to(0.1)
            states.append((*run.state(), run.pressures()))
    one, other = states
    assert np.linalg.norm(one[1], axis=1).max() > 0.5
    assert np.abs(one[0] - other[0]).max() < 1e-5 * S
    assert np.abs(one[1] - other[1]).max() < 1e-5
    assert np.abs(one[4] - other[4]).max() < 1e-5 * one[4].max()


def test_a_hydrostatic_start_has_the_pressure_of_its_depth(taichi_cpu_f64):
    scene = tank(rts.Block((0, 0), (1, 0.5)), domain=rts.Box((0, 0), (1, 1)), hydrostatic=True)
    run = rts.Simulation(scene, rts.Uniform())
    x, p = run.positions(), run.pressures()
    inner = (np.abs(x[:, 0] - 0.5) < 0.2) & (x[:, 1] < 0.45)
    hydrostatic = REST * G * (0.5 - x[inner, 1])
    assert (p[inner] / hydrostatic).mean() == pytest.approx(1.0, abs=0.03)
