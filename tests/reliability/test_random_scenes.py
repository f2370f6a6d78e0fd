"""Scene files that chance has changed: refused with an `rts.Error`, or valid, and then nothing in them is not a number."""

import copy
import json
import math
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenes import FLAT, FOREIGN, SOLID, paths, to_toml, value_at

import taichi_rts as rts
from taichi_rts.assembly.resources import require
from taichi_rts.device.backend import Backend
from taichi_rts.sampling.sampling import sample
from taichi_rts.scene.checks.size import size_of

STEPPERS = [rts.Uniform(), rts.Regional(), rts.Asynchronous()]
NEEDED = ("domain", "spacing", "fluids", "sound_speed")
PARTS = {**SOLID, "obstacles": SOLID["obstacles"][:3]}  # a mesh takes most of the time of a scene
MOST_SAMPLED = 5000
"""Particles that are worth sampling within a test."""

numbers = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(-2.0, 2.0),
    st.sampled_from([0.0, -0.0, 1e-300, 1e-9, 1e-4, 0.05, 1e3, 1e9, 1e12, 1e13, 1e300, math.nan, math.inf, -math.inf]),
    st.integers(-(2**70), 2**70),
    st.integers(-3, 3),
)
words = st.one_of(
    st.text(max_size=8), st.sampled_from(["x-", "regional", "auto", "box", "../a.csv", "/dev/zero", "a\0b"])
)
values = st.recursive(
    st.one_of(numbers, numbers, words, st.booleans()),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.sampled_from(["time", "lower", "x"]), inner)
    ),
    max_leaves=4,
)


@st.composite
def wholes(draw):
    """A valid scene that uses a few features: with all of them at once there would be fewer examples in the same time."""
    if draw(st.integers(0, 3)) == 0:
        return copy.deepcopy(FLAT)
    used = (*NEEDED, *draw(st.lists(st.sampled_from(sorted(set(PARTS) - set(NEEDED))), max_size=3, unique=True)))
    return copy.deepcopy({key: PARTS[key] for key in used})


@st.composite
def mutated(draw):
    """A valid scene of which some values are others, gone, twice there, or scaled."""
    return to_toml(draw(spoiled(wholes()))).encode()


@st.composite
def mutated_json(draw):
    """The same of a SPlisHSPlasH scene, in JSON, which knows NaN and Infinity."""
    return json.dumps(draw(spoiled(st.builds(copy.deepcopy, st.just(FOREIGN))))).encode()


@st.composite
def spoiled(draw, sources):
    data = draw(sources)
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(paths(data)))
        owner, key = value_at(data, path[:-1]), path[-1]
        change = draw(st.sampled_from(["value", "value", "number", "scale", "remove", "repeat"]))
        if change == "remove":
            del owner[key]
        elif change == "repeat" and isinstance(owner, list):
            owner.append(copy.deepcopy(owner[key]))
        elif change == "scale" and isinstance(owner[key], float):
            owner[key] *= draw(st.sampled_from([-1.0, 1e-6, 0.5, 2.0, 1e3, 1e6]))
        else:
            owner[key] = draw(numbers if change == "number" else values)
    return data


@st.composite
def garbled(draw, text):
    """A text in which some bytes are others."""
    text = bytearray(draw(text))
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, len(text) - 1))
        length = draw(st.integers(0, 6))
        text[place : place + length] = draw(
            st.one_of(st.binary(max_size=4), st.sampled_from([b"", b"9", b"e9", b"]", b"-"]))
        )
    return bytes(text)


def attempts(count):
    """Settings for `count` examples, the same in every run."""
    return settings(
        max_examples=count,
        deadline=10_000,  # [ms] of the clock: far more than any scene takes, even on a busy machine; what hangs takes longer
        derandomize=True,
        database=None,
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large],
    )


whole_texts = wholes().map(lambda data: to_toml(data).encode())
foreign_text = json.dumps(FOREIGN).encode()


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # NumPy's of numbers that are refused right after
@given(text=st.one_of(mutated(), mutated(), mutated(), garbled(whole_texts), st.binary(max_size=60)))
@attempts(1000)
@pytest.mark.slow
def test_never_a_traceback_never_a_hang_never_a_nan(folder, text):
    check(folder / "scene.toml", text)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@given(text=mutated())
@attempts(150)
def test_the_same_of_fewer_scenes(folder, text):
    check(folder / "scene.toml", text)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@given(text=st.one_of(mutated_json(), mutated_json(), mutated_json(), garbled(st.just(foreign_text))))
@attempts(300)
def test_the_same_of_scenes_of_splishsplash(folder, text):
    check(folder / "scene.json", text)


def test_the_whole_scene_of_splishsplash_is_valid(folder):
    (folder / "scene.json").write_bytes(foreign_text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = rts.load_scene(folder / "scene.json")
    assert (len(scene.fluids), len(scene.inflows), len(scene.obstacles)) == (2, 1, 1)


def check(path, text):
    path.write_bytes(text)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = rts.load_scene(path)
            require(scene, STEPPERS, Backend("cpu", "f32"))
            if size_of(scene).particles + size_of(scene).walls > MOST_SAMPLED:
                return
            start = sample(scene)
    except rts.Error:
        return
    for values in (start.positions, start.velocities, start.densities, start.viscosities, start.walls.positions):
        assert np.isfinite(values.astype(np.float32)).all()
    assert (start.densities > 0.0).all()
    assert (start.positions >= np.array(scene.domain.lower) - scene.spacing).all()
    assert 0.0 < np.float32(start.mass) < np.inf
