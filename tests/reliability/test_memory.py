"""The memory that the parts of a run declare against what is really allocated."""

import math
from types import SimpleNamespace

import pytest

import taichi_rts as rts
from taichi_rts.assembly import memory
from taichi_rts.assembly.build import assemble
from taichi_rts.assembly.inventory import parts
from taichi_rts.device import backend as backends
from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.fields import Declared
from taichi_rts.sampling.sampling import sample
from taichi_rts.scene.placing import at_origin
from taichi_rts.solver.grid.tiles import Tiles
from taichi_rts.solver.grid.windows import FluidWindows, WallWindows
from taichi_rts.solver.physics.keepers import DistanceTables, RestingKeeper
from taichi_rts.solver.physics.moving_walls import MovingFace
from taichi_rts.solver.physics.obstacles import MovingBody
from taichi_rts.solver.physics.own_forces import own_forces

FEW = 128
"""Entries of a field that is not counted, at most: single numbers, counts, tables of short motions."""


@pytest.fixture
def made(monkeypatch):
    """Bytes of every field of several entries that is made from a declaration, and entries of every other."""
    found, declaring = SimpleNamespace(declared=[], others=[]), []
    originals = {"matrix": ti.Matrix.field, "make": Declared.make}

    def counting(make, entries):
        def counted(*args, **options):
            dtype, shape = args[entries], args[entries + 1]
            places = math.prod(shape) if isinstance(shape, tuple) else shape
            count = math.prod(args[:entries]) * places
            if declaring and places > 1:
                found.declared.append(count * (8 if ti.lang.util.cook_dtype(dtype) in (ti.f64, ti.i64) else 4))
            else:
                found.others.append(count)
            with monkeypatch.context() as patch:  # a vector is made as a matrix
                patch.setattr(ti.Matrix, "field", originals["matrix"])
                return make(*args, **options)

        return counted

    def from_declaration(declared, real=float):
        declaring.append(declared)
        field = originals["make"](declared, real)
        declaring.pop()
        return field

    for owner, entries in ((ti, 0), (ti.Vector, 1), (ti.Matrix, 2)):
        monkeypatch.setattr(owner, "field", counting(owner.field, entries))
    monkeypatch.setattr(Declared, "make", from_declaration)
    return found


def counted(solver):
    """Return what the parts of a run have how many of."""
    still = [wall for wall in solver.walls if not wall.moves]
    return memory.Counts(
        particles=solver.particles.capacity,
        blocks=solver.grid.geometry.blocks,
        at_rest=sum(wall.count for wall in still),
        faces=tuple(wall.count for wall in solver.walls if isinstance(wall, MovingFace)),
        bodies=tuple((wall.count, wall.geometry.blocks) for wall in solver.walls if isinstance(wall, MovingBody)),
        nodes=next(
            ((tables.values.shape[0], tables.scale.shape[0]) for tables in parts(solver, DistanceTables)), (0, 0)
        ),
        bins=next(((keeper.start.shape[0], keeper.near.shape[0]) for keeper in parts(solver, RestingKeeper)), (0, 0)),
        window=max((windows.capacity for windows in parts(solver, FluidWindows)), default=0),
        wall_window=max((windows.capacity for windows in parts(solver, WallWindows)), default=0),
        slots=next((tiles.slots for tiles in parts(solver, Tiles)), 0),
        rows=next((tiles.rows for tiles in parts(solver, Tiles)), 0),
    )


POOL = {"fluids": (rts.Block((0.0, 0.0), (1.0, 0.5)),), "domain": rts.Box((0.0, 0.0), (1.0, 1.0)), "spacing": 0.05}
TANK = {
    "fluids": (rts.Block((0.0, 0.0, 0.0), (1.0, 0.4, 0.6)),),
    "domain": rts.Box((0.0, 0.0, 0.0), (1.0, 1.0, 0.6)),
    "spacing": 0.1,
}
PISTON = rts.MovingWall("x-", (0.0, 1.0), (0.0, 0.1))
BLADE = rts.BoxObstacle((0.2, 0.6), (0.4, 0.7), motion=rts.ConstantMotion(angular_velocity=3.0))
ROLLER = rts.SphereObstacle((0.5, 0.7, 0.3), 0.15, motion=rts.ConstantMotion((0.1, 0.0, 0.0), (0.0, 0.0, 3.0)))
BALL = rts.SphereObstacle((0.3, 0.8), 0.1)
STILL = rts.BoxObstacle((0.7, 0.0), (0.8, 0.3))
OIL = rts.Block((0.0, 0.5), (0.5, 0.7), kinematic_viscosity=0.1)
JET = rts.Inflow((0.4, 1.0), (0.6, 1.0), (0.0, -2.0))
HOLE = rts.Outlet((0.0, 0.0), (0.2, 0.2))

CASES = {
    "uniform": (POOL, rts.Uniform(), "f32"),
    "adaptive": (POOL | {"sound_speed": "regional"}, rts.Uniform(adaptive=True), "f64, debug"),
    "3D": (TANK, rts.Regional(), "f64"),
    "regional sound": (TANK | {"sound_speed": "regional"}, rts.Regional(), "f32, debug"),
    "paper": (POOL | {"fluids": (*POOL["fluids"], OIL)}, rts.Regional(preset="paper"), "f32"),
    "one level": (POOL | {"periodic": ("x",)}, rts.Regional(levels=1), "f32"),
    "graded": (POOL, rts.Regional(levels=4, grading=True, limiter=False), "f32"),
    "no walls": (POOL | {"periodic": ("x", "y")}, rts.Regional(levels=16, inactive_density="extrapolated"), "f64"),
    "asynchronous": (TANK, rts.Asynchronous(), "f32, debug"),
    "continuity": (POOL | {"density": "continuity"}, rts.Asynchronous(levels=1), "f32"),
    "inflow": (POOL | {"inflows": (JET,), "outlets": (HOLE,), "end_time": 0.5}, rts.Asynchronous(), "f32"),
    "piston": (POOL | {"moving_walls": (PISTON,), "obstacles": (STILL, BALL)}, rts.Regional(levels=2), "f32"),
    "turning": (POOL | {"obstacles": (STILL, BLADE)}, rts.Regional(), "f64"),
    "rolling": (TANK | {"obstacles": (ROLLER,), "support_ratio": 3.0}, rts.Uniform(), "f32"),
}
HALL = {
    "fluids": (rts.Block((50.0, 50.0), (50.4, 50.4)),),
    "domain": rts.Box((0.0, 0.0), (100.0, 100.0)),
    "spacing": 0.04,
}
CASES |= {
    "hall": (HALL, rts.Regional(), "f32"),
    "hall, regional sound": (HALL | {"sound_speed": "regional"}, rts.Asynchronous(), "f64, debug"),
}
GRAPHICS = ("uniform", "regional sound", "asynchronous", "turning", "hall")


def check(case, made, backend):
    """Compare what a run allocates for `case`, field by field, with what its parts declare for its counts; return those."""
    parameters, stepper, options = CASES[case]
    scene, debug = rts.Scene(**parameters), "debug" in options
    made.declared.clear(), made.others.clear()
    local = at_origin(scene.with_sound_for(stepper))
    counts = counted(assemble(local, stepper, sample(local), backend, own_forces(()), debug=debug))
    declared = memory.declared_fields(scene, stepper, backend, counts, debug=debug)
    real = 8 if "f64" in options else 4
    sizes = [field.size(real) for fields in declared.values() for field in fields if field.entries != 1]
    assert sorted(sizes) == sorted(made.declared)
    assert max(made.others) <= FEW
    assert sum(made.others) * real <= memory.FIXED
    return scene, stepper, counts, sum(sizes)


@pytest.mark.parametrize("case", CASES)
def test_every_field_is_counted(case, made, start_taichi):
    options = CASES[case][2]
    with start_taichi("cpu", options[:3]) as backend:
        scene, stepper, counts, total = check(case, made, backend)
    estimate = memory.count(scene, stepper)
    for exact in ("blocks", "nodes", "bins", "window", "slots", "rows"):
        assert getattr(estimate, exact) == getattr(counts, exact)
    said = memory.device_bytes(scene.with_sound_for(stepper), stepper, options[:3], debug="debug" in options)
    assert 1.0 <= said / total < 1.35  # wall particles, and the windows on them, are estimated from above


@pytest.mark.parametrize("case", GRAPHICS)
def test_every_field_of_a_graphics_device_is_counted(case, made, start_taichi, monkeypatch):
    backend = Backend("vulkan", CASES[case][2][:3])
    with start_taichi("cpu", backend.precision):
        monkeypatch.setattr("taichi_rts.solver.grid.grid.on_cpu", lambda: False)
        monkeypatch.setattr(backends, "current", lambda: backend)
        check(case, made, backend)
