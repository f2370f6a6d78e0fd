"""What is said of memory before a run against what is really allocated."""

import math

import pytest

import taichi_rts as rts
from taichi_rts.assembly import resources
from taichi_rts.device.backend import Backend, ti
from taichi_rts.sampling.sampling import sample
from taichi_rts.scene.checks.size import MOST, finest_spacing, size_of

CPU = Backend("cpu", "f32")


STEPPERS = {"uniform": rts.Uniform(), "regional": rts.Regional(), "asynchronous": rts.Asynchronous()}
SCENES = {
    "dam_break": "uniform",
    "dam_break_2d": "regional",
    "dam_break_obstacle": "asynchronous",
    "water_jet": "regional",
    "projectile": "asynchronous",
}
"""With the stepper that is not left to the slow tests."""

every_scene_and_stepper = pytest.mark.parametrize(
    ("name", "stepper"),
    [
        pytest.param(name, stepper, id=f"{name}-{key}", marks=[] if key == quick else pytest.mark.slow)
        for name, quick in SCENES.items()
        for key, stepper in STEPPERS.items()
    ],
)


@pytest.fixture
def allocated(monkeypatch):
    """Bytes of all fields that are made, as a list of one number a field."""
    found = []

    def counting(make, entries):
        def counted(*args, **options):
            dtype, shape = args[entries], args[entries + 1]
            count = math.prod(shape) if isinstance(shape, tuple) else shape
            bytes_each = 8 if ti.lang.util.cook_dtype(dtype) in (ti.f64, ti.i64) else 4
            found.append(count * bytes_each * math.prod(args[:entries]))
            with monkeypatch.context() as patch:  # a vector is made as a matrix
                patch.setattr(ti.Matrix, "field", originals["matrix"])
                return make(*args, **options)

        return counted

    originals = {"matrix": ti.Matrix.field}
    for owner, entries in ((ti, 0), (ti.Vector, 1), (ti.Matrix, 2)):
        monkeypatch.setattr(owner, "field", counting(owner.field, entries))
    return found


@every_scene_and_stepper
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


@pytest.fixture
def buffers(monkeypatch):
    """Bytes of each of Taichi's buffers, in the order in which they are made: of the fields between two launches of kernels."""
    found, open_fields = [], []
    make, end = ti.field, ti.lang.impl.PyTaichi.materialize_root_fb

    def counted(dtype, shape, **options):
        open_fields.append(
            math.prod(shape if isinstance(shape, tuple) else (shape,)) * (8 if dtype in (ti.f64, ti.i64) else 4)
        )
        return make(dtype, shape, **options)

    def vectors(kind, entries):
        make = kind.field

        def counted(*args, **options):
            shape = args[entries + 1]
            open_fields.append(
                math.prod(args[:entries]) * math.prod(shape if isinstance(shape, tuple) else (shape,)) * 4
            )
            with monkeypatch.context() as patch:
                patch.setattr(ti.Matrix, "field", matrix)
                return make(*args, **options)

        return counted

    def ended(first):
        if open_fields:
            found.append(sum(open_fields))
            open_fields.clear()
        return end(first)

    matrix = ti.Matrix.field
    monkeypatch.setattr(ti, "field", counted)
    monkeypatch.setattr(ti.Vector, "field", vectors(ti.Vector, 1))
    monkeypatch.setattr(ti.Matrix, "field", vectors(ti.Matrix, 2))
    monkeypatch.setattr(ti.lang.impl.PyTaichi, "materialize_root_fb", staticmethod(ended))
    return found


@every_scene_and_stepper
def test_no_buffer_of_a_graphics_device_is_larger_than_is_said(
    name, stepper, buffers, unstarted, start_taichi, monkeypatch
):
    scene = rts.load_scene(name, **({"sound_speed": "regional"} if name == "projectile" else {}))
    with start_taichi("cpu", "f32"):
        for owner in ("device.backend", "solver.grid.grid"):
            monkeypatch.setattr(f"taichi_rts.{owner}.on_cpu", lambda: False)
        monkeypatch.setattr("taichi_rts.device.backend.current", lambda: Backend("vulkan", "f32"))
        buffers.clear()
        rts.Simulation(scene, stepper)
    assert 1.0 - 1e-9 <= max(resources.buffer_bytes(scene, stepper, "f32").values()) / max(buffers) <= 1.2


def test_a_buffer_beyond_32_bit_addresses_is_refused(monkeypatch):
    vulkan, huge = Backend("vulkan", "f32"), rts.load_scene("dam_break", particles=90_000_000)
    monkeypatch.setattr(resources, "free_host_memory", lambda: math.inf)
    monkeypatch.setattr(resources, "free_device_memory", lambda backend: math.inf)
    made = []
    monkeypatch.setattr(ti, "field", lambda *args, **options: made.append(args))
    monkeypatch.setattr(ti.Vector, "field", lambda *args, **options: made.append(args))
    message = (
        r"needs 4\.\d+ GiB for the grid and what neighbours see with spacing [\d.e-]+, and kernels address no more than "
        r"4 GiB at a time on vulkan; use a spacing of at least [\d.e-]+, or use --arch cuda or cpu"
    )
    with pytest.raises(rts.Error, match=message) as caught:
        resources.require(huge, [rts.Uniform()], vulkan)
    assert not made
    best = float(str(caught.value).split("at least ")[1].split(",")[0])
    assert huge.spacing < best < 1.2 * huge.spacing
    resources.require(huge.replace(spacing=best), [rts.Uniform()], vulkan)
    for arch in ("cuda", "cpu"):
        resources.require(huge, [rts.Uniform()], Backend(arch, "f32"))
    with pytest.raises(rts.Error, match="more than 4 GiB at a time"):  # whose state is larger
        resources.require(huge.replace(spacing=best), [rts.Asynchronous()], vulkan)


def test_a_domain_that_the_water_does_not_fill_is_named(monkeypatch):
    hall = rts.Scene(domain=rts.Box((0, 0, 0), (100, 100, 100)), fluids=[rts.Block((0, 0, 0), (1, 1, 1))], spacing=0.1)
    monkeypatch.setattr(resources, "free_host_memory", lambda: 2.0**30)
    resources.require(hall, [rts.Uniform()], CPU)  # whose grid follows the water
    hall = hall.replace(obstacles=[rts.SphereObstacle((50, 50, 50), 1.0)])
    message = (
        r"domain of 100 x 100 x 100 m has 2.6e\+08 cells and its walls, of which the water fills 1e-06: make the domain"
    )
    with pytest.raises(rts.Error, match=message):
        resources.require(hall, [rts.Uniform()], CPU)
    with pytest.raises(rts.SceneError, match=message.replace("2.6e\\+08", r"3.9e\+09")):
        hall.replace(spacing=0.04)
