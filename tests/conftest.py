import os
from contextlib import contextmanager

import pytest

import taichi_rts as rts
from taichi_rts.device import backend
from taichi_rts.device.backend import ti

QUICK = {"advanced_optimization": False}
"""Compiles a quarter faster. Not where bits of different kernels are compared."""


@pytest.fixture(scope="session")
def quick():
    return QUICK


@pytest.fixture(scope="session")
def on_demand():
    """Return a dictionary that makes what is asked for, once, with a function of the key: slow tests may ask for more."""

    class OnDemand(dict):
        def __init__(self, make):
            super().__init__()
            self.make = make

        def __missing__(self, key):
            self[key] = self.make(key)
            return self[key]

    return OnDemand


@pytest.fixture(scope="module")
def quick_environment(kernel_cache):
    """The same for what calls `rts.init` itself: commands, and programs in processes of their own."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in QUICK.items():
            patch.setenv(f"TI_{name.upper()}", str(int(value)))
        yield


@pytest.fixture(scope="session", autouse=True)
def kernel_cache(tmp_path_factory):
    """One for the whole run: what one process has compiled, neither xdist's other workers nor subprocesses compile again."""
    run = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        run = run.parent  # xdist gives each worker a folder of its own
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TI_OFFLINE_CACHE_FILE_PATH", str(run / "taichi_cache"))
        yield


@pytest.fixture(scope="session")
def start_taichi(kernel_cache):
    @contextmanager
    def start(arch="cpu", precision="f32", **options):
        try:
            yield rts.init(arch, precision, **options)
        finally:
            ti.reset()

    return start


@pytest.fixture
def taichi_cpu(start_taichi):
    with start_taichi("cpu", "f32") as started:
        yield started


@pytest.fixture
def taichi_cpu_f64(start_taichi):
    with start_taichi("cpu", "f64", **QUICK) as started:
        yield started


@pytest.fixture
def taichi_vulkan(start_taichi):
    if not backend.vulkan_device_types():
        pytest.skip("no Vulkan driver on this machine")
    with start_taichi("vulkan", "f32") as started:
        yield started


@pytest.fixture
def simulate(kernel_cache):
    """Return a function that builds a Simulation in double precision, and ends the one before.

    It starts Taichi anew: of a second Simulation in one program, the cache does not know the same kernels again.
    """

    def build(*args, **options):
        rts.init("cpu", "f64", restart=True, **QUICK)
        return rts.Simulation(*args, **options)

    yield build
    ti.reset()


@pytest.fixture
def unstarted(monkeypatch):
    """Simulations evaluate no first forces, so that next to nothing is compiled: for what they know before."""
    monkeypatch.setattr(rts.Simulation, "start", lambda sim: None)
