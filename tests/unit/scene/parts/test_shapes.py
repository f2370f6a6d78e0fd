"""Boxes, blocks, spheres and fields by themselves."""

import dataclasses
import math

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.scene.fluids.shapes import separation


@pytest.mark.parametrize("shape", [rts.Box, rts.Block])
def test_corners(shape):
    with pytest.raises(rts.SceneError, match=r"upper \(1\.0, 0\.0\) must exceed lower \(0\.0, 0\.0\)"):
        shape((0, 0), (1, 0))
    with pytest.raises(rts.SceneError, match="differ in dimension; give both 2 or both 3"):
        shape((0, 0), (1, 1, 1))
    with pytest.raises(rts.SceneError, match="finite"):
        shape((0, math.nan), (1, 1))


@pytest.mark.parametrize("radius", [0, -1, math.nan, math.inf])
def test_radius_is_positive_and_finite(radius):
    with pytest.raises(rts.SceneError, match=r"^Sphere: radius: Input should be .*\(got "):
        rts.Sphere((0, 0), radius)


def test_an_invalid_component_is_reported_once_and_by_name():
    with pytest.raises(rts.SceneError) as caught:
        rts.Block((0, math.nan), (1, 1))
    assert str(caught.value) == "Block: lower.1: Input should be a finite number (got nan)"


@pytest.mark.parametrize(("shape", "kind"), [(rts.Block((0, 0), (1, 1)), "block"), (rts.Sphere((0, 0), 1), "sphere")])
def test_velocity_of_a_fluid_has_its_dimension(shape, kind):
    with pytest.raises(rts.SceneError, match=rf"velocity \(0\.0, 0\.0, 1\.0\) has 3 components; the {kind} has 2"):
        dataclasses.replace(shape, velocity=(0, 0, 1))
    with pytest.raises(rts.SceneError, match=rf"velocity field has 3 components; the {kind} has 2"):
        dataclasses.replace(shape, velocity=rts.LinearField(((0, 0, 0),) * 3))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"gradient": ((1, 0, 0), (0, 1))}, r"gradient: row 0 has 3 components; 2 rows need 2"),
        (
            {"gradient": ((1, 0), (0, 1)), "value": (1, 2, 3)},
            r"value \(1.0, 2.0, 3.0\) has 3 components; the gradient has 2",
        ),
        (
            {"gradient": ((1, 0), (0, 1)), "origin": (1, 2, 3)},
            r"origin \(1.0, 2.0, 3.0\) has 3 components; the gradient has 2",
        ),
        ({"gradient": ((1, 0),)}, r"gradient: .*at least 2"),
        ({"gradient": ((1, math.nan), (0, 1))}, r"gradient\.0\.1: .*finite number \(got nan\)"),
        ({"gradient": ((1, 0), (0, 1)), "value": (math.inf, 0)}, r"value\.0: .*finite number \(got inf\)"),
        ({"gradient": ((1, 0), (0, 1)), "orign": (0, 0)}, r"orign: unknown key; did you mean 'origin'"),
    ],
)
def test_faults_of_a_linear_field(arguments, message):
    with pytest.raises(rts.SceneError, match="^LinearField: " + message):
        rts.LinearField(**arguments)


def test_all_faults_of_a_linear_field_come_at_once():
    with pytest.raises(rts.SceneError) as caught:
        rts.LinearField(((1, 0), (0, 1, 2)), value=(1, 2, 3), origin=(0, 0, 0))
    assert str(caught.value).count("\n") == 2


def test_linear_field():
    field = rts.LinearField(((1, 2), (3, 4)), value=(10, 20), origin=(1, -1))
    assert field.at(np.array([[1, -1], [2, -1], [1, 0]])).tolist() == [[10, 20], [11, 23], [12, 24]]
    assert rts.LinearField(((1, 2), (3, 4))).at(np.array([1, 1])).tolist() == [3, 7]
    assert not field.is_conservative
    force = rts.LinearField(((1, 2), (2, -4)), value=(10, 20), origin=(1, -1))
    assert force.is_conservative
    x, step = np.array([0.3, 0.7]), 1e-4
    slope = [force.potential(x - e) - force.potential(x + e) for e in step * np.eye(2)]
    assert np.array(slope) / (2 * step) == pytest.approx(force.at(x), rel=1e-9)
    assert force.potential(np.array([1, -1])) == 0


def test_volume_and_reach_of_shapes():
    assert rts.Sphere((1, 2), 3).volume == pytest.approx(28.274333882308138)
    assert rts.Sphere((1, 2, 3), 3).volume == pytest.approx(113.09733552923255)
    assert rts.Sphere((1, 2), 3).reach((3, 4)) == pytest.approx(11 + 15)
    assert rts.Box((1, 2), (3, 5)).reach((-1, 2)) == rts.Block((1, 2), (3, 5)).reach((-1, 2)) == 9


def test_separation_of_spheres_and_blocks():
    ball, block = rts.Sphere((0, 0), 1), rts.Block((3, 4), (6, 6))
    assert separation(ball, block) == separation(block, ball) == 4.0
    assert separation(rts.Sphere((4, 5), 1), block) == -1.0
    assert separation(ball, rts.Sphere((3, 4), 2)) == 2.0
    assert separation(block, rts.Block((6, 0), (7, 5))) == 0.0
    assert separation(block, rts.Block((5, 0), (7, 4.5))) == -0.5
