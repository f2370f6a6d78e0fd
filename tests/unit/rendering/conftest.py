import pytest
import taichi as ti


@pytest.fixture(scope="session")
def cache_folder(tmp_path_factory):
    return str(tmp_path_factory.mktemp("taichi_cache"))


@pytest.fixture
def taichi_cpu(cache_folder):
    ti.init(arch=ti.cpu, offline_cache_file_path=cache_folder, log_level=ti.ERROR)
    yield
    ti.reset()
