"""The same bits whatever the threads do: state, levels, energy and statistics (docs/evidence/reliability.md)."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from repeat import STEPPERS, leavings

from taichi_rts.device import backend

pytestmark = pytest.mark.slow  # `make test` compares one thread with all in tests/conformance/test_steppers.py


@pytest.mark.parametrize("stepper", STEPPERS)
def test_any_number_of_threads_gives_the_same_bits(start_taichi, quick, stepper):
    runs = []
    for count in (1, 2, 4):
        with start_taichi("cpu", "f32", cpu_max_num_threads=count, **quick):
            runs.append(leavings(stepper))
    for run in runs[1:]:
        assert not [name for name in runs[0] if run[name] != runs[0][name]]


def test_a_vulkan_device_repeats_itself(kernel_cache):
    """Mesa's rasteriser takes its number of threads from the environment; a hardware driver runs twice the same."""
    if not backend.vulkan_device_types():
        pytest.skip("no Vulkan driver on this machine")
    said = [
        subprocess.run(
            [sys.executable, str(Path(__file__).parent / "repeat.py"), "vulkan", "f32", "regional", "0.01"],
            env=os.environ | {"LP_NUM_THREADS": str(threads)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in (0, 2, 4)
    ]
    assert said[0].count("\n") == 15
    assert said == said[:1] * 3
