"""Two columns collapse towards each other and collide (Goswami & Batty 2014, Figure 3), in the paper's setting.

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 1.5M --panels figure3.
"""

from taichi_rts.commands.main import run_demo

SCENE = "double_dam_break"
EXPORT_FPS = 60.0  # frames per second of physical time
PRESET = "paper"

if __name__ == "__main__":
    run_demo(SCENE, export_fps=EXPORT_FPS, preset=PRESET)
