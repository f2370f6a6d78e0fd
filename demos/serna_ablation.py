"""The first moments of the double dam break, without and with Serna's corrector (Goswami & Batty 2014, Figure 2).

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 300k --stepper uniform.
"""

from taichi_rts.commands.main import run_demo

SCENE = "serna_ablation"
EXPORT_FPS = 60.0  # frames per second of physical time

if __name__ == "__main__":
    run_demo(SCENE, export_fps=EXPORT_FPS)
