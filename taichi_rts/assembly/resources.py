"""Compares what a run needs with what is available, before anything is allocated: memory, and ticks of its clock."""

from __future__ import annotations

import contextlib
import math
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from taichi_rts.device.backend import Backend, has_vulkan_hardware
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.errors import ResourceError
from taichi_rts.scene.checks.size import finest_spacing, size_of
from taichi_rts.scene.obstacles.making import make_solid
from taichi_rts.scene.obstacles.solid import PAD, grid_nodes
from taichi_rts.scene.placing import origin_of, translated
from taichi_rts.solver.grid import resorting
from taichi_rts.solver.grid.windows import entries, room
from taichi_rts.solver.physics.keepers import MOST_BINS
from taichi_rts.solver.stepping.timeline import MAX_TICKS

if TYPE_CHECKING:
    from taichi_rts.scene.scene import Scene

INTEGER = 4  # bytes
SAMPLING = 50
"""Bytes of the host per particle and dimension while a scene is sampled, at most (measured: 49 in two and three dimensions)."""
TABULATING = 100
"""Bytes of the host per node of an obstacle's table of distances while that is filled."""
LINING = 10 * SAMPLING
"""Bytes of the host per boundary particle of an obstacle and dimension: they are chosen from about ten times as many points."""
COMPILED = 400 << 20
"""Bytes that Python, the compiler and compiled kernels take in addition."""
FIXED = 1 << 14
"""Bytes of fields whose size does not depend on the scene, about."""
WALL_SHARE = 0.45
"""Entries of the windows on a wall at rest over those of the windows on the fluid at r = 2s, about."""
SOUND_REALS = 9
"""Fields of reals with an entry for each block that a regional sound speed needs."""
MOST_ADDRESSED = 2**32 - 1
"""Bytes of one buffer on Vulkan and Metal, at most: kernels in SPIR-V compute 32-bit addresses, which wrap round beyond
that.

Taichi puts all fields that are made between two launches of kernels into one buffer, one behind the other.
"""
SINGLE, DOUBLE = 2.0**-24, 2.0**-53
"""Largest relative error of rounding a number."""
FINEST_POSITION = 0.001
"""Share of the spacing by which positions may be rounded: a still pool then moves half as fast again
(docs/evidence/reliability.md)."""


def device_bytes(
    scene: Scene,
    stepper: Any,
    precision: str,
    *,
    debug: bool = False,
    spacing: float | None = None,
    on_cpu: bool = True,
) -> float:
    """Bytes of all fields of a `Simulation`: what its parts allocate for each particle, wall particle, cell and block."""
    return sum(buffer_bytes(scene, stepper, precision, debug=debug, spacing=spacing, on_cpu=on_cpu).values())


def buffer_bytes(
    scene: Scene,
    stepper: Any,
    precision: str,
    *,
    debug: bool = False,
    spacing: float | None = None,
    on_cpu: bool = False,
) -> dict[str, float]:
    """Bytes of the fields that a `Simulation` makes one after the other, of which none launches a kernel in between, or more."""
    size, dim, real = size_of(scene, spacing), scene.dim, 8 if precision == "f64" else 4
    regional = scene.with_sound_for(stepper).regional_sound is not None
    integrated = scene.density == "continuity"
    faces, turning = len(scene.moving_walls), sum(body.motion is not None for body in scene.obstacles)
    pose = 2 * dim + dim * dim + (1 if dim == 2 else 3)
    viscous = len(set(scene.viscosities)) > 1
    # Reals and integers of `FluidState`.
    reals, integers = 3 * dim + 1, 3 + 1 + bool(scene.inflows)
    reals += 1 if stepper.extrapolates_density or integrated else 0
    reals += 1 if integrated else 0
    reals += 2 * dim + 1 if stepper.keeps_past else 0
    reals += 1 if viscous else 0
    reals += 2 if regional else 0
    reals += 3 * dim + 3 if debug else 0
    near = 2 * dim + 2 + (dim + 1) * integrated + viscous
    per_block = INTEGER * (2 * CELLS_PER_BLOCK + (1 if on_cpu else 3)) + real * SOUND_REALS * regional
    walls_per_block = INTEGER * (CELLS_PER_BLOCK + 1) * (1 + faces) + real * pose * turning
    steps_per_block = INTEGER * stepper.block_integers
    nodes = sum(_nodes(scene, spacing))
    windows = entries(room(dim, (scene.support_ratio * (1.0 + 2.0 * stepper.drift)) ** dim))
    wall_reals = 2 * dim + 1 + (scene.wall_planes > 1)
    share = WALL_SHARE * scene.wall_planes * 2.0 / scene.support_ratio
    reals_seen = near + (share * wall_reals if scene.walls and not scene.periodic else 0.0)
    return {
        "the particles' state": size.particles * (real * reals + INTEGER * integers),
        "the particles' order": size.particles * INTEGER * 3,
        "the grid and what neighbours see": size.particles * real * near
        + size.blocks * per_block
        + (windows * real * reals_seen + INTEGER * resorting.integers(size.particles, size.blocks) if on_cpu else 0.0),
        "walls": (size.walls + _lining(scene, spacing)) * real * wall_reals
        + size.particles * real * 2 * faces
        + size.blocks * walls_per_block,
        "the distances from obstacles": nodes * real + INTEGER * _bins(scene, spacing),
        "steps": size.particles * INTEGER * 2 + size.blocks * steps_per_block + FIXED,
    }


def host_bytes(scene: Scene, *, spacing: float | None = None) -> float:
    """Largest number of bytes that sampling takes on the host; the arrays of a frame need less."""
    size = size_of(scene, spacing)
    obstacles = _lining(scene, spacing) * scene.dim * LINING + max(_nodes(scene, spacing), default=0.0) * TABULATING
    return (size.particles + size.walls) * scene.dim * SAMPLING + obstacles


def _nodes(scene: Scene, spacing: float | None) -> list[float]:
    """Number of nodes of each obstacle's table of distances."""
    found = []
    for obstacle in scene.obstacles:
        solid = make_solid(obstacle, scene.spacing, scene.domain)
        _origin, shape, _step = grid_nodes(solid.lower, solid.upper, spacing or scene.spacing)
        found.append(math.prod(map(float, shape)))
    return found


def _bins(scene: Scene, spacing: float | None) -> float:
    """Number of bins, and of entries in them, in which obstacles at rest are looked up, at most."""
    s = spacing or scene.spacing
    resting = [each for each in scene.obstacles if each.motion is None]
    if not resting:
        return 0.0
    solids = [make_solid(each, scene.spacing, scene.domain) for each in resting]
    extents = np.array([solid.upper - solid.lower for solid in solids]) + 3.0 * PAD * s
    whole = np.max([solid.upper for solid in solids], axis=0) - np.min([solid.lower for solid in solids], axis=0)
    bins = float(np.prod((whole + 3.0 * PAD * s) / (2.0 * PAD * s) + 1.0))
    return min(bins, 2.0**scene.dim * MOST_BINS) + float(np.prod(extents / (2.0 * PAD * s) + 2.0, axis=1).sum())


def _lining(scene: Scene, spacing: float | None) -> float:
    """Number of boundary particles of all obstacles: that of their bounding boxes."""
    s, total = spacing or scene.spacing, 0.0
    for obstacle in scene.obstacles:
        solid = make_solid(obstacle, scene.spacing, scene.domain)
        sides = [length / s + 1.0 for length in solid.upper - solid.lower]
        total += sum(2.0 * math.prod(sides[:d] + sides[d + 1 :]) for d in range(scene.dim))
    return total * scene.wall_planes


def free_host_memory() -> float:
    """Bytes that this process may still take: what the system has available, or less in a container; infinite if unknown."""
    found = [math.inf]
    with contextlib.suppress(OSError, ValueError):
        facts = dict(line.split(":") for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines())
        found.append(1024.0 * float(facts["MemAvailable"].split()[0]))
    for limit, used in (
        ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
        ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
    ):
        with contextlib.suppress(OSError, ValueError):  # "max" is no number: there is no limit
            found.append(float(Path(limit).read_text()) - float(Path(used).read_text()))
    return max(0.0, min(found))


def free_device_memory(backend: Backend) -> float:
    """Bytes free on the device that kernels run on, infinite where nothing can be asked.

    Taichi cannot say it: on CUDA nvidia-smi does, on a CPU and a software Vulkan it is the host's memory.
    """
    if backend.arch == "cuda":
        with contextlib.suppress(OSError, ValueError, subprocess.SubprocessError):
            command = ["nvidia-smi", "--query-gpu=memory.free", "--format=csv,noheader,nounits"]
            said = subprocess.run(command, capture_output=True, text=True, timeout=5.0, check=True).stdout
            return float(said.splitlines()[0]) * 2.0**20
        return math.inf
    if backend.arch == "vulkan" and has_vulkan_hardware():
        return math.inf
    return free_host_memory()


def require_memory(
    scene: Scene, steppers: Iterable[Any], backend: Backend, *, debug: bool = False, pictures: int = 0
) -> None:
    """Raise `ResourceError` if runs of `scene` by all `steppers` and `pictures` bytes of pictures do not fit into memory."""
    steppers = list(steppers)

    def needs(spacing: float | None) -> tuple[float, float]:
        device = sum(
            device_bytes(scene, each, backend.precision, debug=debug, spacing=spacing, on_cpu=backend.arch == "cpu")
            for each in steppers
        )
        return device + pictures, host_bytes(scene, spacing=spacing) + COMPILED

    host, device = free_host_memory(), free_device_memory(backend)
    shared = backend.arch == "cpu" or (backend.arch == "vulkan" and device == host)

    def lacking(spacing: float | None) -> tuple[str, float, float] | None:
        on_device, on_host = needs(spacing)
        checks = [("memory", on_device + on_host, host)]
        if not shared:
            checks = [(f"memory of the {backend.arch} device", on_device, device), ("memory", on_host, host)]
        return next((check for check in checks if check[1] > check[2]), None)

    if found := lacking(None):
        where, needed, free = found
        best = finest_spacing(lambda s: lacking(s) is None, scene.spacing)
        remedy = (
            f"use a spacing of at least {best:g}" if math.isfinite(best) else "free some, or make the scene smaller"
        )
        raise ResourceError(
            f"scene {scene.name!r} needs {text(needed)} of {where} with spacing {scene.spacing:g}, "
            f"and {text(free)} are free; {remedy}"
        )


def require_addresses(scene: Scene, steppers: Iterable[Any], backend: Backend, *, debug: bool = False) -> None:
    """Raise `ResourceError` if fields that share a buffer are larger than what kernels can address on this device."""
    if backend.arch in ("cpu", "cuda"):  # whose addresses have 64 bits
        return
    steppers = list(steppers)

    def largest(spacing: float | None) -> tuple[float, str]:
        found = (buffer_bytes(scene, each, backend.precision, debug=debug, spacing=spacing) for each in steppers)
        return max((count, name) for buffers in found for name, count in buffers.items())

    needed, name = largest(None)
    if needed > MOST_ADDRESSED:
        best = finest_spacing(lambda s: largest(s)[0] <= MOST_ADDRESSED, scene.spacing)
        remedy = f"use a spacing of at least {best:g}" if math.isfinite(best) else "make the scene smaller"
        raise ResourceError(
            f"scene {scene.name!r} needs {text(needed)} for {name} with spacing {scene.spacing:g}, and kernels address no more "
            f"than {text(MOST_ADDRESSED)} at a time on {backend.arch}; {remedy}, or use --arch cuda or cpu"
        )


def require_clock(scene: Scene, stepper: Any, end_time: float | None = None) -> None:
    """Raise `ResourceError` if a run of `scene` to `end_time` [s] has more ticks than 32 bits count."""
    end_time = scene.end_time if end_time is None else end_time
    tick = stepper.timeline(scene.with_sound_for(stepper)).tick
    if not (tick > 0.0 and end_time <= tick * MAX_TICKS):
        raise ResourceError(
            f"end_time {end_time:g} s takes {end_time / tick if tick > 0.0 else math.inf:.3g} ticks of {tick:.3g} s, more than "
            f"{MAX_TICKS} that are counted; end at {tick * MAX_TICKS:.3g} s at the latest, or use a larger courant or spacing, "
            "or a smaller sound_speed or viscosity"
        )


def require_resolution(scene: Scene, precision: str) -> None:
    """Raise `ResourceError` if positions in the domain are rounded too coarsely for the spacing.

    A run counts them from `origin_of` the scene, so what counts is the domain's size. The scene's own numbers, and what is read
    of the run, are in double precision and count from 0.
    """
    limit = FINEST_POSITION * scene.spacing

    def reach(domain: Any) -> float:
        return max(map(abs, (*domain.lower, *domain.upper)))

    farthest = reach(scene.domain)
    if (rounding := farthest * DOUBLE) > limit:
        raise ResourceError(
            f"the domain reaches {farthest:g} m from 0, where numbers in double precision are rounded by {rounding:.3g} m, more "
            f"than {FINEST_POSITION:g} of the spacing {scene.spacing:g}; move it towards 0, or use a spacing of at least "
            f"{rounding / FINEST_POSITION:.3g}"
        )
    if precision == "f64":
        return
    size = reach(translated(scene.domain, tuple(-x for x in origin_of(scene))))
    if (rounding := size * SINGLE) > limit:
        raise ResourceError(
            f"positions in the domain reach {size:g} m, where {precision} rounds them by {rounding:.3g} m, more than "
            f"{FINEST_POSITION:g} of the spacing {scene.spacing:g}; use --precision f64, or a spacing of at least "
            f"{rounding / FINEST_POSITION:.3g}"
        )


def require(scene: Scene, steppers: Iterable[Any], backend: Backend, *, debug: bool = False, pictures: int = 0) -> None:
    """Raise `ResourceError` or `StepperError` if `scene` cannot be run by all `steppers` on this device."""
    steppers = list(steppers)
    for stepper in steppers:
        require_clock(scene, stepper)
    require_addresses(scene, steppers, backend, debug=debug)
    require_memory(scene, steppers, backend, debug=debug, pictures=pictures)
    require_resolution(scene, backend.precision)  # last: its remedy, double precision, takes more memory


def text(count: float) -> str:
    """Return a number of bytes as text."""
    return f"{count / 2**30:.3g} GiB" if count >= 2**29 else f"{count / 2**20:.3g} MiB"
