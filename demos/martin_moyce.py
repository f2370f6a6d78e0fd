"""The dam break of Martin & Moyce 1952: a column of base a = 2.25 in and height 2 a.

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 300k --stepper uniform.
"""

from taichi_rts.commands.main import run_demo

SCENE = "martin_moyce"
EXPORT_FPS = 60.0  # frames per second of physical time

if __name__ == "__main__":
    run_demo(SCENE, export_fps=EXPORT_FPS)
