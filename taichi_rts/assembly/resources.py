"""Compares what a run needs with what is available, before anything is allocated: memory, and ticks of its clock."""

from __future__ import annotations

import contextlib
import math
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taichi_rts.assembly.memory import buffer_bytes, device_bytes, host_bytes
from taichi_rts.device.backend import Backend, has_vulkan_hardware
from taichi_rts.errors import ResourceError
from taichi_rts.scene.checks.size import finest_spacing, remedy
from taichi_rts.scene.placing import origin_of, translated
from taichi_rts.solver.stepping.timeline import MAX_TICKS

if TYPE_CHECKING:
    from taichi_rts.scene.scene import Scene

COMPILED = 400 << 20
"""Bytes that Python, the compiler and compiled kernels take in addition."""
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
        raise ResourceError(
            f"scene {scene.name!r} needs {text(needed)} of {where} with spacing {scene.spacing:g}, "
            f"and {text(free)} are free; {remedy(scene, best)}"
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
        raise ResourceError(
            f"scene {scene.name!r} needs {text(needed)} for {name} with spacing {scene.spacing:g}, and kernels address no more "
            f"than {text(MOST_ADDRESSED)} at a time on {backend.arch}; {remedy(scene, best)}, or use --arch cuda or cpu"
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
