from contextlib import contextmanager

import pytest
import taichi as ti

import taichi_rts as rts
from taichi_rts import backend

QUICK = {"advanced_optimization": False}
"""Compiles a quarter faster. Not where bits of different kernels are compared."""


@pytest.fixture(scope="session")
def quick():
    return QUICK


@pytest.fixture(scope="session")
def start_taichi(tmp_path_factory):
    cache = str(tmp_path_factory.mktemp("taichi_cache"))  # shared, so that a kernel met before is not compiled again

    @contextmanager
    def start(arch="cpu", precision="f32", **options):
        try:
            yield rts.init(arch, precision, offline_cache_file_path=cache, **options)
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
