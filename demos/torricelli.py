"""A tank drains through a hole in its floor; an outlet takes the water away.

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 300k --stepper uniform.
"""

from taichi_rts.commands.main import run_demo

SCENE = "torricelli"
EXPORT_FPS = 20.0  # frames per second of physical time

if __name__ == "__main__":
    run_demo(SCENE, export_fps=EXPORT_FPS, colour_by="speed")
