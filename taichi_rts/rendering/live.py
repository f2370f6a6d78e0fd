"""Watch a run in a window."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from taichi_rts.rendering.ggui import LiveWindow
from taichi_rts.rendering.painter import Painter, PictureOptions, make_camera, milliseconds
from taichi_rts.scene import Scene
from taichi_rts.simulation import Simulation

STEPS_PER_FRAME = 4  # base steps between two pictures, or as many as the longest step has


def watch(scene: Scene, stepper: Any, options: PictureOptions, start: Callable[[], object]) -> Simulation:
    """Run `scene` in a window until its end time, then keep showing it until the window is closed.

    `start` initialises Taichi. Raises `RenderError` without a display or Vulkan.
    """
    start()
    window = LiveWindow(options.width, options.height, f"taichi_rts: {scene.name}")
    sim = Simulation(scene, stepper)
    painter = Painter(scene, options, renderer=window)
    camera, outline = make_camera(scene, options), (scene.domain.lower, scene.domain.upper)
    frame = max(STEPS_PER_FRAME, sim.schedule.levels) * sim.base_step
    while window.running:
        if not window.paused and sim.time < scene.end_time:
            sim.advance_to(min(sim.time + frame, scene.end_time))
        x, v, rho, level = sim.state()
        statistics = sim.statistics
        lines = [
            f"t = {sim.time:.3f} of {scene.end_time:g} s" + (" (paused)" if window.paused else ""),
            f"{sim.stepper.name} steps, base step {milliseconds(sim.base_step)} ms",
            f"active {statistics['active_fraction']:.1%}",
            f"{sim.count:,} particles",
        ]
        x, tints = painter.obstacles.add(x, painter.colours(sim, v, rho, level), sim.time)
        window.draw(x, tints, 0.5 * scene.spacing, camera, outline, lines)
    window.close()
    return sim
