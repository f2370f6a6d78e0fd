"""The dam is released and a second block of water is dropped on top (Goswami & Batty 2014, Figure 4).

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 300k --stepper uniform.
"""

from taichi_rts.commands.main import run_demo

SCENE = "dam_break_drop"
EXPORT_FPS = 60.0  # frames per second of physical time

if __name__ == "__main__":
    run_demo(SCENE, export_fps=EXPORT_FPS)
