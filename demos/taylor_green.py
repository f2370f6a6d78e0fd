"""Vortices on periodic axes decay.

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 300k --stepper uniform.
"""

from taichi_rts.commands.main import run_demo

SCENE = "taylor_green"
EXPORT_FPS = 500.0  # frames per second of physical time

if __name__ == "__main__":
    run_demo(SCENE, export_fps=EXPORT_FPS)
