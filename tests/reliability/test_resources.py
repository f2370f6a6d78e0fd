"""What is said of memory before a run against what is really allocated."""

import math

import pytest
import taichi as ti
from taichi.lang.util import cook_dtype

import taichi_rts as rts
from taichi_rts import resources
from taichi_rts.backend import Backend
from taichi_rts.sampling import sample
from taichi_rts.scene_size import MOST, finest_spacing, size_of

CPU = Backend("cpu", "f32")


@pytest.fixture
def allocated(monkeypatch):
    """Bytes of all fields that are made, as a list of one number a field."""
    found = []

    def counting(make, entries):
        def counted(*args, **options):
            dtype, shape = args[entries], args[entries + 1]
            count = math.prod(shape) if isinstance(shape, tuple) else shape
            bytes_each = 8 if cook_dtype(dtype) in (ti.f64, ti.i64) else 4
            found.append(count * bytes_each * math.prod(args[:entries]))
            with monkeypatch.context() as patch:  # a vector is made as a matrix
                patch.setattr(ti.Matrix, "field", originals["matrix"])
                return make(*args, **options)

        return counted

    originals = {"matrix": ti.Matrix.field}
    for owner, entries in ((ti, 0), (ti.Vector, 1), (ti.Matrix, 2)):
        monkeypatch.setattr(owner, "field", counting(owner.field, entries))
    return found


@pytest.mark.parametrize("name", ["dam_break", "dam_break_2d", "dam_break_obstacle", "water_jet", "projectile"])
@pytest.mark.parametrize("stepper", [rts.Uniform(), rts.Regional(), rts.Asynchronous()], ids=lambda each: each.name)
def test_the_estimate_is_never_less_and_a_fifth_more_at_most(name, stepper, allocated, unstarted, start_taichi):
    changes = {"projectile": {"sound_speed": "regional"}, "dam_break_obstacle": {"support_ratio": 3.0}}
    scene = rts.load_scene(name, **changes.get(name, {}))
    with start_taichi("cpu", "f32"):
        rts.Simulation(scene, stepper)
    assert 1.0 <= resources.device_bytes(scene, stepper, "f32") / sum(allocated) <= 1.2


@pytest.mark.parametrize("name", rts.scene_names())
def test_sizes_without_sampling(name):
    scene = rts.load_scene(name)
    start, size = sample(scene), size_of(scene)
    assert len(start.positions) <= size.particles * 1.02 + 1
    assert len(start.walls.positions) <= size.walls + 1
    if not scene.inflows and not scene.obstacles:
        assert len(start.positions) >= size.particles * 0.9


def test_what_does_not_fit_is_refused_before_it_is_sampled(monkeypatch):
    scene = rts.load_scene("dam_break")
    grows = resources.device_bytes(scene, rts.Uniform(), "f32") + resources.host_bytes(scene)
    monkeypatch.setattr(resources, "free_host_memory", lambda: grows * 1.001 + resources.COMPILED)
    resources.require(scene, [rts.Uniform()], CPU)
    monkeypatch.setattr(resources, "free_host_memory", lambda: grows * 0.9 + resources.COMPILED)
    message = r"needs \d+ MiB of memory with spacing 0.025, and \d+ MiB are free; use a spacing of at least"
    with pytest.raises(rts.Error, match=message) as caught:
        resources.require(scene, [rts.Uniform()], CPU)
    best = float(str(caught.value).split("at least ")[1])
    assert 0.025 < best <= 0.027
    resources.require(scene.replace(spacing=best), [rts.Uniform()], CPU)


def test_the_finest_spacing():
    assert finest_spacing(lambda s: 1.0 / s**3 <= 1e6, 1e-7) == pytest.approx(0.01, rel=0.1)
    assert finest_spacing(lambda s: 1.0 / s**3 <= 1e6, 1e-7) >= 0.01
    assert math.isinf(finest_spacing(lambda s: False, 1.0))
    scene = rts.load_scene("dam_break")
    with pytest.raises(rts.SceneError, match=f"more than the {MOST} that 32 bits count; use a spacing of at least"):
        scene.replace(spacing=1e-5)
