"""The only place that calls `ti.init`: which device runs the kernels, and in which precision."""

from __future__ import annotations

import contextlib
import ctypes
import ctypes.util
import io
import os
from dataclasses import dataclass
from typing import Any

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")

import numpy as np
import taichi as ti
from taichi.lang import kernel_impl
from taichi.lang.ast import ast_transformer_utils

from taichi_rts import positions
from taichi_rts.errors import BackendError

ARCHES = ("cuda", "vulkan", "cpu")  # the order in which `auto` tries them
PRECISIONS = {"f32": (ti.f32, np.float32), "f64": (ti.f64, np.float64)}
_REMEDIES = {
    "cuda": "install an NVIDIA driver, or use --arch cpu",
    "vulkan": "install a Vulkan driver (Debian: apt-get install libvulkan1 mesa-vulkan-drivers), or use --arch cpu",
    "cpu": "reinstall taichi for this platform",
}
CHUNK = 512
"""Iterations of a loop that Taichi gives to a CPU thread at a time, whatever `block_dim` says; shorter loops run in one."""
_VK_DEVICE_TYPE_CPU = 4  # VkPhysicalDeviceType of a software rasteriser such as Mesa's lavapipe


@dataclass(frozen=True)
class Backend:
    """What was initialised: `arch` and `precision` as named by the user, and what follows from them."""

    arch: str
    precision: str

    @property
    def dtype(self) -> Any:
        """Taichi's floating-point type."""
        return PRECISIONS[self.precision][0]

    @property
    def numpy_dtype(self) -> Any:
        """The same as a NumPy type."""
        return PRECISIONS[self.precision][1]

    @property
    def lanes(self) -> int:
        """Candidates per inner loop of constant length; 1 is a plain loop.

        LLVM turns 16 candidates into vector instructions, while a loop of unknown length over the same 15-25
        candidates runs mostly in its scalar remainder: 203 against 694 ns per particle and core in a density pass.
        """
        return 16 if self.arch == "cpu" else 1


_current: Backend | None = None
positions.remember(ast_transformer_utils, kernel_impl)


def init(arch: str = "auto", precision: str = "f32", **taichi_options: Any) -> Backend:
    """Start Taichi on `arch` (auto, cuda, vulkan or cpu) with `precision` (f32 or f64).

    `auto` takes the first of cuda, vulkan, cpu that works; it passes over a Vulkan that is only a software
    rasteriser, which is slower than the CPU backend (name it to get it). Simulations made before a second call are
    no longer usable. Further keywords go to `ti.init`.

    Raises `BackendError` if the arch is unknown or missing; nothing falls back silently.
    """
    global _current
    if arch not in ("auto", *ARCHES):
        raise BackendError(f"arch {arch!r} is unknown; choose one of auto, {', '.join(ARCHES)}")
    if precision not in PRECISIONS:
        raise BackendError(f"precision {precision!r} is unknown; choose one of {', '.join(PRECISIONS)}")
    ti.set_logging_level(ti.ERROR)
    candidates = ARCHES if arch == "auto" else (arch,)
    for name in candidates:
        if arch == "auto" and name == "vulkan" and not has_vulkan_hardware():
            continue
        if _start(name, precision, taichi_options):
            _current = Backend(name, precision)
            return _current
    raise BackendError(f"arch {arch!r} is not available on this machine; {_REMEDIES[candidates[-1]]}")


def current() -> Backend:
    """Return the backend in use; raises `BackendError` before `init`."""
    if _current is None:
        raise BackendError('Taichi is not initialised; call taichi_rts.init(arch="auto") first')
    return _current


def threads() -> int:
    """Threads that kernels run on with arch cpu; `ti.global_thread_idx()` is less."""
    return int(ti.lang.impl.default_cfg().cpu_max_num_threads)


def on_cpu() -> bool:
    """Whether kernels run on the CPU, where a short loop is quicker in one thread than waking the others."""
    return bool(ti.lang.impl.current_cfg().arch == ti.cpu)


def available() -> dict[str, str]:
    """Say for each arch whether it can be used here, without starting it."""
    ti.set_logging_level(ti.ERROR)  # looking for CUDA warns where there is none
    support = {}
    for name in ARCHES:
        built = ti.lang.misc.is_arch_supported(getattr(ti, name))
        support[name] = "available" if built else f"not available: {_REMEDIES[name]}"
    if support["vulkan"] == "available":
        kinds = vulkan_device_types()
        if not kinds:
            support["vulkan"] = f"not available: {_REMEDIES['vulkan']}"
        elif not has_vulkan_hardware():
            support["vulkan"] = "available (software rasteriser; auto passes over it)"
    return support


def _start(name: str, precision: str, options: dict[str, Any]) -> bool:
    if not ti.lang.misc.is_arch_supported(getattr(ti, name)):
        return False
    if name == "vulkan" and not vulkan_device_types():
        return False
    settings = {"log_level": ti.ERROR, "enable_fallback": False} | options
    others = _thread_ids()
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # its banner would break progress bars and piped output
            ti.init(arch=getattr(ti, name), default_fp=PRECISIONS[precision][0], default_ip=ti.i32, **settings)
    except RuntimeError:
        return False
    if name == "cpu":
        _pin_threads(sorted(_thread_ids() - others))
    return True


def _thread_ids() -> set[int]:
    """Ids of the threads of this process; empty where only Linux could say."""
    try:
        return {int(entry) for entry in os.listdir("/proc/self/task")}
    except OSError:
        return set()


def _pin_threads(started: list[int]) -> None:
    """Give every thread of Taichi's pool, the last of those that `ti.init` has `started`, a core of its own.

    They sleep between loops, and Linux wakes them on the core that they were woken from: two threads then share one core for
    milliseconds, longer than most kernels take (docs/speed.md). Only if there is a thread for every core that the process may
    use: fewer threads are for sharing the machine, and must be free to move. TAICHI_RTS_PIN=0 in the environment turns it off.
    """
    if not hasattr(os, "sched_setaffinity") or os.environ.get("TAICHI_RTS_PIN", "1") == "0":
        return
    cores = sorted(os.sched_getaffinity(0))
    if len(cores) == threads() <= len(started):
        for thread, core in zip(started[-len(cores) :], cores, strict=True):
            with contextlib.suppress(OSError):  # a thread that has ended, or a sandbox that forbids it
                os.sched_setaffinity(thread, {core})


def has_vulkan_hardware() -> bool:
    """True if a Vulkan device that is not a software rasteriser is present."""
    return any(kind != _VK_DEVICE_TYPE_CPU for kind in vulkan_device_types())


def vulkan_device_types() -> list[int]:
    """List the VkPhysicalDeviceType of each Vulkan device; empty without a loader or driver.

    Asked of the loader itself, because Taichi ends the process when it finds a loader without a device.
    """
    name = "vulkan-1" if os.name == "nt" else "vulkan"
    path = ctypes.util.find_library(name)
    try:
        loader = ctypes.CDLL(path or ("vulkan-1.dll" if os.name == "nt" else "libvulkan.so.1"))
    except OSError:
        return []

    class InstanceInfo(ctypes.Structure):  # VkInstanceCreateInfo
        _fields_ = (
            ("type", ctypes.c_int), ("next", ctypes.c_void_p), ("flags", ctypes.c_uint32),
            ("application", ctypes.c_void_p), ("layer_count", ctypes.c_uint32), ("layers", ctypes.c_void_p),
            ("extension_count", ctypes.c_uint32), ("extensions", ctypes.c_void_p),
        )  # fmt: skip

    instance = ctypes.c_void_p()
    if loader.vkCreateInstance(ctypes.byref(InstanceInfo(type=1)), None, ctypes.byref(instance)) != 0:
        return []
    count = ctypes.c_uint32()
    loader.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    devices = (ctypes.c_void_p * count.value)()
    loader.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), devices)
    kinds = []
    for device in devices:
        properties = (ctypes.c_uint32 * 512)()  # VkPhysicalDeviceProperties is 824 bytes; its fifth word is the type
        loader.vkGetPhysicalDeviceProperties(ctypes.c_void_p(device), ctypes.byref(properties))
        kinds.append(properties[4])
    loader.vkDestroyInstance(instance, None)
    return kinds
