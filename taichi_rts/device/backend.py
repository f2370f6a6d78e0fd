"""The only file that imports Taichi, and the only place that calls `ti.init`: device and precision of the kernels.

All others import `ti` from here, so that one environment variable chooses a fork of Taichi for all of them (`forks.py`).
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import ctypes.util
import io
import os
import sys
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from taichi_rts.device import forks, kernel_cache, ownership, source_cache
from taichi_rts.device.ownership import Start, holds_fields, require_own_process
from taichi_rts.device.pinning import Pinning, usage
from taichi_rts.errors import BackendError
from taichi_rts.importing import PROGRAM, runs_as_program


def _import_taichi() -> tuple[forks.Fork, Any]:
    """Import Taichi, or the fork that the environment names.

    Raises `BackendError` if the name is unknown or the fork is not installed; the command line then ends with one line.
    """
    try:
        fork = forks.chosen()
        os.environ.setdefault(fork.banner, "0")
        os.environ.update(kernel_cache.home_for_taichi())
        try:
            return fork, import_module(fork.module)
        except ModuleNotFoundError as error:
            if error.name != fork.module:
                raise
            raise forks.missing(fork) from None
    except BackendError as error:
        if runs_as_program(sys.argv, sys.orig_argv):
            print(f"{PROGRAM}: error: {error}", file=sys.stderr)
            sys.exit(2)
        raise


if TYPE_CHECKING:
    import taichi as ti

    FORK: forks.Fork
else:
    FORK, ti = _import_taichi()
ownership.watch(ti)
source_cache.remember(import_module(f"{FORK.module}.lang.ast.ast_transformer_utils"), ti.lang.kernel_impl)

ARCHES = ("cuda", "vulkan", "cpu")  # the order in which `auto` tries them
_POOL: list[Pinning] = []  # that of the present start, on a CPU
PRECISIONS = {"f32": (ti.f32, np.float32), "f64": (ti.f64, np.float64)}
_REMEDIES = {
    "cuda": "install an NVIDIA driver, or use --arch cpu",
    "vulkan": "install a Vulkan driver (Debian: apt-get install libvulkan1 mesa-vulkan-drivers), or use --arch cpu",
    "cpu": f"reinstall {FORK.package} for this platform",
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
_start_of_current: Start | None = None
_asked_for = ""
"""Arch that `init` was given; empty where it uses a Taichi that was started elsewhere."""
_options: dict[str, Any] = {}
_DEFAULT_CACHE = str(ti.lang.impl.default_cfg().offline_cache_file_path)


def init(
    arch: str = "auto",
    precision: str | None = None,
    *,
    reuse: bool = False,
    restart: bool = False,
    **taichi_options: Any,
) -> Backend:
    """Start Taichi on `arch` (auto, cuda, vulkan or cpu) with `precision` (f32, the default, or f64).

    `auto` takes the first of cuda, vulkan, cpu that works; it passes over a Vulkan that is only a software
    rasteriser, which is slower than the CPU backend (name it to get it). Further keywords go to `ti.init`.

    Once more with the same arguments it changes nothing. With others, or with `restart`, it frees the memory of all
    simulations and fields made before; what is asked of such a simulation then raises `BackendError`. With `reuse` it uses
    the Taichi that `ti.init` has started, on the arch and in the precision that it has, and leaves its fields alone.

    Raises `BackendError` if the arch is unknown or missing (nothing falls back silently), if it would free fields of a
    Taichi that `ti.init` has started, if there is none to reuse or it does not fit, and in a process that was forked after
    Taichi had started (docs/starting.md).
    """
    require_own_process()
    if arch not in ("auto", *ARCHES):
        raise BackendError(f"arch {arch!r} is unknown; choose one of auto, {', '.join(ARCHES)}")
    if precision is not None and precision not in PRECISIONS:
        raise BackendError(f"precision {precision!r} is unknown; choose one of {', '.join(PRECISIONS)}")
    ti.set_logging_level(ti.ERROR)
    if reuse:
        if restart or taichi_options:
            raise BackendError(
                f"reuse leaves Taichi as it is, so {', '.join(['restart'] * restart + sorted(taichi_options))} cannot be obeyed; "
                "leave it out, or give it to ti.init"
            )
        return _remember(_running(arch, precision), "", {})
    precision = precision or "f32"
    lives = _start_of_current is not None and _start_of_current.lives
    if lives and not restart and _is_the_same(arch, precision, taichi_options):
        return current()
    if not (lives and _asked_for) and holds_fields():
        raise BackendError(
            "Taichi was started by ti.init, and init would start it again, which destroys the fields that were made there; "
            "call init(reuse=True) to use it as it is, make your fields after init, or call ti.reset() first to give them up"
        )
    candidates = ARCHES if arch == "auto" else (arch,)
    for name in candidates:
        if arch == "auto" and name == "vulkan" and not has_vulkan_hardware():
            continue
        if _start(name, precision, taichi_options):
            return _remember(Backend(name, precision), arch, taichi_options)
    raise BackendError(f"arch {arch!r} is not available on this machine; {_REMEDIES[candidates[-1]]}")


def current() -> Backend:
    """Return the backend in use; raises `BackendError` before `init`, and where Taichi was started again by others since."""
    require_own_process()
    if _current is None or _start_of_current is None:
        raise BackendError('Taichi is not initialised; call taichi_rts.init(arch="auto") first')
    if not _start_of_current.lives:
        raise BackendError(
            "Taichi was started again by ti.init, or reset, since init; call init(reuse=True) to use it as it is, "
            "or init() once more"
        )
    return _current


def start_for_fields() -> Start:
    """Return the start of Taichi that fields made here and now belong to.

    In another thread than the one that called `init` Taichi is started again if there is nothing yet that this would free.
    Raises `BackendError` as `current` does, and if fields can only be made in that other thread.
    """
    device = current()
    assert _start_of_current is not None
    if _asked_for and not _start_of_current.is_here and not holds_fields():
        init(device.arch, device.precision, restart=True, **_options)
    _start_of_current.require_thread()
    return _start_of_current


def _is_the_same(arch: str, precision: str, options: dict[str, Any]) -> bool:
    """Whether the backend in use is what these arguments of `init` ask for, and need not move to the present thread."""
    assert _current is not None
    assert _start_of_current is not None
    same = precision == _current.precision and (arch == _current.arch or arch == "auto" == _asked_for)
    return same and options == _options and (_start_of_current.is_here or holds_fields())


def _remember(backend: Backend, asked_for: str, options: dict[str, Any]) -> Backend:
    global _current, _start_of_current, _asked_for, _options
    _current, _start_of_current, _asked_for, _options = backend, Start(), asked_for, dict(options)
    return backend


def _running(arch: str, precision: str | None) -> Backend:
    """Return what `ti.init` has started; raises `BackendError` if there is nothing, or it is not as asked for or as needed."""
    runtime = ti.lang.impl.get_runtime()
    if ownership.program(runtime) is None:
        raise BackendError("there is no Taichi to reuse; call ti.init first, or leave out reuse")
    found = {getattr(ti, name): name for name in ARCHES}.get(ti.lang.impl.current_cfg().arch)
    if found is None or arch not in ("auto", found):
        there = found or str(ti.lang.impl.current_cfg().arch).removeprefix("Arch.")
        wanted = arch if found else f"one of {', '.join(ARCHES)}"
        raise BackendError(
            f"Taichi runs on arch {there!r}, and {wanted} is needed; give it to ti.init, or leave out reuse"
        )
    kind = {each[0]: name for name, each in PRECISIONS.items()}.get(runtime.default_fp)
    if kind is None or precision not in (None, kind):
        wanted = precision or "f32 or f64"
        raise BackendError(
            f"Taichi's default_fp is {runtime.default_fp.to_string()}, and {wanted} is needed; "
            "give it to ti.init, or leave out reuse"
        )
    if runtime.default_ip != ti.i32:
        raise BackendError(
            f"Taichi's default_ip is {runtime.default_ip.to_string()}, and i32 is needed; give it to ti.init, or leave out reuse"
        )
    return Backend(found, kind)


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
    settings = {"log_level": ti.ERROR, "enable_fallback": False} | FORK.options | options
    folder = str(os.environ.get(kernel_cache.VARIABLE) or _DEFAULT_CACHE)
    if FORK.module != "taichi":  # each throws away what it finds of another
        folder = os.path.join(folder, FORK.module)
    folder = str(options.get("offline_cache_file_path") or folder)
    settings["offline_cache_file_path"] = kernel_cache.usable_folder(folder)
    others, before = _thread_ids(), usage()
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # its banner would break progress bars and piped output
            ti.init(arch=getattr(ti, name), default_fp=PRECISIONS[precision][0], default_ip=ti.i32, **settings)
    except RuntimeError:
        return False
    atexit.unregister(_end)
    atexit.register(_end)
    _POOL.clear()
    if name == "cpu":
        _POOL.append(Pinning(sorted(_thread_ids() - others), threads(), before))
    return True


def _end() -> None:
    """End Taichi with the process: only then does it write the kernels that it has compiled.

    What still refers to a simulation, a traceback for example, would keep Python from doing so by itself.
    """
    if ownership.program(ti.lang.impl.get_runtime()) is not None:  # None in a forked child
        ti.reset()


def _thread_ids() -> set[int]:
    """Ids of the threads of this process; empty where only Linux could say."""
    try:
        return {int(entry) for entry in os.listdir("/proc/self/task")}
    except OSError:
        return set()


def settle_threads() -> None:
    """Give the threads of Taichi's pool a core each, or let them go, by what other processes use (`pinning`)."""
    if _POOL:
        _POOL[0].look()


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
