"""A column of water collapses in a tank, and every block of water keeps its own time; coloured by step.

The longest step is 0.8 r/c_s, twice the default, so that the front and the impact have to take shorter ones.
Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 300k --steps integers --colour-by lead.
"""

from pathlib import Path

from taichi_rts.commands.main import run_demo

SCENE = "dam_break"
STEPPER = "asynchronous"
COURANT, LEVELS = 0.8, 16
COLOUR_BY = "step"
EXPORT_FPS = 60.0  # frames per second of physical time
OUTPUT_DIR = Path("out/asynchronous_dam_break")

if __name__ == "__main__":
    run_demo(
        SCENE,
        stepper=STEPPER,
        courant=COURANT,
        levels=LEVELS,
        colour_by=COLOUR_BY,
        export_fps=EXPORT_FPS,
        output_dir=OUTPUT_DIR,
    )
