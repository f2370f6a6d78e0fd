"""The live window as it is: in an X server without a screen, with keys and the mouse sent to it, seen in screenshots."""

import importlib.util
import os
import shutil
import signal
import struct
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from taichi_rts.device import backend

SIZE = (480, 360)
SCENE = """
spacing = 0.05
end_time = 0.2
domain = { lower = [0, 0], upper = [1, 1] }
fluids = [{ lower = [0, 0], upper = [0.5, 0.8] }]
"""
LEVEL_1, PLAIN = (0xD5, 0x5E, 0x00), (56, 127, 204)

pytestmark = pytest.mark.skipif(
    not (shutil.which("Xvfb") and shutil.which("xdotool")),
    reason="needs Xvfb and xdotool: apt-get install xvfb xdotool",
)


@contextmanager
def running(command, **options):
    process = subprocess.Popen(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.communicate(timeout=20)


@pytest.fixture
def screen(tmp_path, monkeypatch):
    """Start an X server, and return a function that takes a screenshot, (H, W, 3)."""
    if not backend.vulkan_device_types():
        pytest.skip("no Vulkan driver on this machine")
    reader, writer = os.pipe()
    command = ["Xvfb", "-displayfd", str(writer), "-screen", "0", "800x600x24", "-fbdir", str(tmp_path)]
    with running(command, pass_fds=[writer]):
        os.close(writer)
        with open(reader) as pipe:
            monkeypatch.setenv("DISPLAY", f":{int(pipe.readline())}")
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)

        def shot():
            data = (tmp_path / "Xvfb_screen0").read_bytes()  # an X window dump
            header = struct.unpack(">25I", data[:100])
            start, width, height, row = header[0] + 12 * header[19], header[4], header[5], header[12]
            pixels = np.frombuffer(data, np.uint8, height * row, start).reshape(height, row)[:, : 4 * width]
            return pixels.reshape(height, width, 4)[..., 2::-1].astype(int)

        yield shot


def pixels_of(picture, colour):
    """Number of pixels that have the hue of `colour`, however bright: light falls on spheres."""
    unit = np.array(colour) / np.linalg.norm(colour)
    length = np.linalg.norm(picture, axis=-1)
    return int(((picture @ unit > 0.985 * length) & (length > 60) & (np.ptp(picture, axis=-1) > 40)).sum())


def wait_for(condition, seconds=60.0):
    for _ in range(int(seconds / 0.2)):
        if condition():
            return
        time.sleep(0.2)
    raise AssertionError("the window did not do it in time")


@pytest.mark.slow
def test_keys_and_mouse_in_a_real_window(screen, tmp_path, quick_environment):
    (tmp_path / "pool.toml").write_text(SCENE)
    command = [sys.executable, "-c", "from taichi_rts.commands.main import main; main()", "run", "pool.toml", "--gui"]
    command += ["--arch", "cpu", "--stepper", "uniform", "--output-dir", "out", "--width", "480", "--height", "360"]
    path = os.pathsep.join([str(Path(__file__).parents[3]), *sys.path])

    def send(*words):
        subprocess.run(["xdotool", *map(str, words)], check=True)

    def water(colour=LEVEL_1):
        return pixels_of(
            screen()[100:360, 400:580], colour
        )  # of the window at (100, 100), right of the panel, above the plot

    with running(command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": path}) as process:
        wait_for(lambda: water() > 500 or process.poll() is not None)
        assert process.poll() is None, process.communicate()[1]
        send("mousemove", 500, 300)
        wait_for(lambda: (screen()[100:460, 100:580] > 250).all(axis=-1).sum() > 10_000)
        send("key", "space")
        time.sleep(1.0)
        still = screen()
        time.sleep(0.5)
        np.testing.assert_array_equal(screen()[110:450, 400:570], still[110:450, 400:570])  # paused
        for _ in range(8):  # level, step, lead, speed, density, sound, fluid, pressure, plain
            send("key", "c")
            time.sleep(0.3)
        wait_for(lambda: water(PLAIN) > 500)
        assert water() == 0
        before = screen()
        for words in (
            ["mousedown", 3],
            ["mousemove_relative", "--", 0, -60],
            ["mouseup", 3],
        ):  # a drag lasts for frames
            send(*words)
            time.sleep(0.5)
        wait_for(lambda: np.abs(screen() - before)[100:460, 400:580].max(axis=-1).astype(bool).sum() > 2000)
        send("mousemove", 500, 300, "key", "s")
        wait_for(lambda: list((tmp_path / "out" / "window" / "states").glob("*.npz")))
        if importlib.util.find_spec("Xlib"):
            send("key", "period", "key", "v", "key", "period", "key", "period", "key", "v")
            wait_for(lambda: list((tmp_path / "out" / "window").glob("recording-001/000000.png")))
        send("key", "Escape")
        wait_for(lambda: process.poll() is not None)
        assert process.returncode == 0
    assert not (tmp_path / "imgui.ini").exists()
