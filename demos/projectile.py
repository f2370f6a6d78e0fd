"""A block of water hits a still pool at half the sound speed: only where it hits do steps have to be short.

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 1M --stepper asynchronous.
"""

from taichi_rts.cli import run_demo

SCENE = "projectile"
EXPORT_FPS = 200.0  # frames per second of physical time

if __name__ == "__main__":
    run_demo(SCENE, export_fps=EXPORT_FPS)
