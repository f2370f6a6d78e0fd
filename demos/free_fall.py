"""A block of water falls freely: exact for every stepper.

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 300k --stepper uniform.
"""

from taichi_rts.commands.main import run_demo

SCENE = "free_fall"
EXPORT_FPS = 60.0  # frames per second of physical time

if __name__ == "__main__":
    run_demo(SCENE, export_fps=EXPORT_FPS)
