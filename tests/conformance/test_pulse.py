"""A sound pulse meets a change of sound speed: how much of its energy comes back.

The sound speeds are put in by hand and stay (the memory is endless), in a periodic bar under a pressure that keeps it from
tearing; the reference densities are such that it is the same everywhere. Of a step by a factor q ((q-1)/(q+1))^2 comes back.
Measured, for a pulse of two blocks' width at 1/1000 of compression (f64), as shares of the energy sent:

    no change                                     0.0009
    factor 2 at once                              0.115    theory 0.111
    factor 2 over 5 blocks                        0.008
    factor 2 over 10 blocks                       0.002
    factor 8 at once                              0.659    theory 0.605
    factor 8 by steps of 2, a block each          0.578    which is what the rule's halves of neighbours can come to
    factor 8 over 3 blocks, smoothly              0.576
"""

import numpy as np
import pytest

import taichi_rts as rts

S, R, LENGTH, INTERFACE, START, WIDTH, C, REST, P = 0.05, 0.1, 6.0, 2.0, 1.2, 0.2, 10.0, 1000.0, 3000.0
SCENE = rts.Scene(
    domain=rts.Box((0, 0), (LENGTH, 0.4)),
    fluids=[rts.Block((0, 0), (LENGTH, 0.4), velocity=(1, 0))],
    spacing=S,
    gravity=(0, 0),
    periodic=("x", "y"),
    artificial_viscosity=0.0,
    sound_speed=rts.RegionalSound(mach=10.0, floor=C, cap=8 * C, memory=1e9),
)


def graded(factor, length):
    return lambda x: C * factor ** np.clip((x - INTERFACE) / length, 0, 1)


PROFILES = {
    "same": (lambda x: np.full_like(x, C), 0.0, 0.002),
    "twice": (lambda x: np.where(x < INTERFACE, C, 2 * C), 0.09, 0.135),
    "twice_over_5_blocks": (graded(2, 5 * R), 0.0, 0.02),
    "twice_over_10_blocks": (graded(2, 10 * R), 0.0, 0.006),
    "eightfold": (lambda x: np.where(x < INTERFACE, C, 8 * C), 0.55, 0.72),
    "eightfold_by_blocks": (lambda x: C * 2.0 ** np.clip(np.floor((x - INTERFACE) / R + 1), 0, 3), 0.45, 0.65),
    "eightfold_over_3_blocks": (graded(8, 3 * R), 0.45, 0.65),
}


@pytest.fixture(scope="module")
def bar(start_taichi, quick):
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(SCENE, rts.Uniform())
        yield sim, sim.particles.to_numpy(sim.particles.x)


def send(sim, x, sound):
    """Send the pulse, and return the shares of its energy that run back and forth before the change, and of all energy."""
    p, z = sim.particles, (x[:, 0] - START) / WIDTH
    c = sound(x[:, 0])
    speed = 2e-3 * C * z * np.exp(-z * z)  # -c d(shift)/dx: it runs along x
    placed = x + np.stack([1e-3 * WIDTH * np.exp(-z * z), 0 * z], axis=1)
    p.identity.from_numpy(np.arange(sim.count, dtype=np.int32))
    p.x.from_numpy(placed)
    p.v.from_numpy(np.stack([speed, 0 * z], axis=1))
    p.a.fill(0.0)
    p.rho.fill(REST)
    p.sound.from_numpy(c)
    p.reference.from_numpy(REST * (1 + 7 * P / (REST * c * c)) ** (-1 / 7))
    p.updated.fill(sim.timeline.now)
    sim.step()  # the clock stands still
    sim.advance_to(sim.time + 0.125)  # 0.08 s to the change, 0.045 s back
    x, v, rho, _ = sim.state()
    assert sim.sound_speeds() == pytest.approx(c)
    push = (sim.pressures() - P) / (rho * c)
    before = x[:, 0] < INTERFACE - 0.5 * R
    back, forth = 0.5 * (v[:, 0] - push), 0.5 * (v[:, 0] + push)
    sent = (speed**2).sum()
    return (
        (back[before] ** 2).sum() / sent,
        (forth[before] ** 2).sum() / sent,
        0.5 * (v[:, 0] ** 2 + push**2).sum() / sent,
    )


@pytest.mark.parametrize("name", PROFILES)
def test_what_comes_back(bar, name):
    sound, least, most = PROFILES[name]
    back, forth, energy = send(*bar, sound)
    assert least <= back <= most
    assert forth < 0.15  # it has passed
    assert energy == pytest.approx(
        1.0, abs=0.25
    )  # measured 1.12 to 1.20: the smoothed density sees less of a pulse so short
