import os
import subprocess
import sys

import pytest

import taichi_rts as rts
from taichi_rts.device import backend
from taichi_rts.device.backend import ti


def test_unknown_arch_and_precision_list_the_choices():
    with pytest.raises(rts.BackendError, match="arch 'gpu' is unknown; choose one of auto, cuda, vulkan, cpu"):
        rts.init("gpu")
    with pytest.raises(rts.BackendError, match="precision 'f16' is unknown; choose one of f32, f64"):
        rts.init("cpu", "f16")


def test_missing_cuda_is_one_error_that_names_the_remedy():
    if ti.lang.misc.is_arch_supported(ti.cuda):
        pytest.skip("this machine has CUDA")
    with pytest.raises(rts.BackendError, match=r"'cuda' is not available on this machine; .* --arch cpu"):
        rts.init("cuda")
    assert "--arch cpu" in backend.available()["cuda"]


def test_missing_vulkan_is_one_error_that_names_the_remedy(monkeypatch):
    monkeypatch.setattr(backend, "vulkan_device_types", list)
    with pytest.raises(rts.BackendError, match=r"'vulkan' is not available on this machine; .* --arch cpu"):
        rts.init("vulkan")
    assert "--arch cpu" in backend.available()["vulkan"]


def test_auto_passes_over_software_vulkan(start_taichi, monkeypatch):
    if ti.lang.misc.is_arch_supported(ti.cuda):
        pytest.skip("this machine has CUDA")
    monkeypatch.setattr(backend, "vulkan_device_types", lambda: [4])
    with start_taichi("auto") as started:
        assert started.arch == "cpu"


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_precision_reaches_taichi(start_taichi, precision):
    with start_taichi("cpu", precision) as started:
        assert backend.current() is started
        assert started.dtype is getattr(ti, precision)
        assert started.numpy_dtype.__name__ == {"f32": "float32", "f64": "float64"}[precision]
        assert ti.field(float, ()).dtype == started.dtype


def test_importing_starts_nothing_and_a_simulation_says_what_to_call():
    code = (
        "import taichi_rts as rts; from taichi_rts.device.backend import ti\n"
        "rts.load_scene('dam_break'); rts.Regional()\n"
        "assert ti.lang.impl.get_runtime().prog is None\n"
        "import sys; assert 'scipy.spatial' not in sys.modules  # which takes longer to import than NumPy\n"
        "try: rts.Simulation(rts.load_scene('dam_break_2d'))\n"
        "except rts.BackendError as error: print(error)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "not initialised; call taichi_rts.init" in result.stdout
    assert "[Taichi]" not in result.stdout


def test_public_names_exist():
    for name in rts.__all__:
        assert getattr(rts, name) is not None
    errors = [value for name in rts.__all__ if isinstance(value := getattr(rts, name), type) and "Error" in name]
    assert len(errors) >= 8
    assert all(issubclass(error, rts.Error) for error in errors)


def imported(choice, code="import taichi_rts"):
    environment = os.environ | {"TAICHI_RTS_TAICHI": choice}
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment)


def test_an_unknown_fork_is_one_error_that_names_the_choices():
    said = imported("tachi").stderr.splitlines()
    assert said[-1] == (
        "taichi_rts.errors.BackendError: TAICHI_RTS_TAICHI='tachi' in the environment is unknown; choose one of taichi, "
        "taichi_forge, quadrants, and install a fork with pip install 'taichi_rts[forge]' or 'taichi_rts[quadrants]'"
    )


@pytest.mark.parametrize(("fork", "extra"), [("taichi_forge", "forge"), ("quadrants", "quadrants")])
def test_a_missing_fork_is_one_error_that_names_the_remedy(fork, extra):
    hidden = f"import sys; sys.modules[{fork!r}] = None\nimport taichi_rts"
    said = imported(fork, hidden).stderr.splitlines()
    assert said[-1].startswith(
        f"taichi_rts.errors.BackendError: TAICHI_RTS_TAICHI='{fork}' is not installed; install it with "
        f"pip install 'taichi_rts[{extra}]', or set TAICHI_RTS_TAICHI to another of taichi, taichi_forge, quadrants"
    )


def test_the_command_line_ends_with_one_line_where_the_fork_is_unknown():
    command = [sys.executable, "-m", "taichi_rts", "scenes"]
    environment = os.environ | {"TAICHI_RTS_TAICHI": "tachi"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 2
    assert done.stderr.startswith("taichi-rts: error: TAICHI_RTS_TAICHI='tachi' in the environment is unknown")
    assert done.stderr.count("\n") == 1


def test_users_get_the_same_taichi():
    assert rts.ti is ti is sys.modules[backend.FORK.module]
    code = "import sys, taichi_rts as rts; assert rts.ti is sys.modules['taichi']; print(rts.ti.__name__)"
    assert imported("", code).stdout == "taichi\n"


def test_without_ggui_the_window_says_what_to_do(monkeypatch):
    from taichi_rts.rendering import ggui

    monkeypatch.setattr(ggui, "ti", object())  # as quadrants is
    with pytest.raises(
        rts.RenderError, match=r"has no GGUI.* use --renderer splatter without --gui, or set TAICHI_RTS"
    ):
        ggui.open_window("", 64, 64, visible=False)
