"""A column of water collapses in a tank, and every block of water keeps its own time; coloured by step.

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 300k --steps integers --colour-by lead.
"""

from pathlib import Path

from taichi_rts.cli import run_demo

SCENE = "dam_break"
STEPPER = "asynchronous"
COLOUR_BY = "step"
EXPORT_FPS = 60.0  # frames per second of physical time
OUTPUT_DIR = Path("out/asynchronous_dam_break")

if __name__ == "__main__":
    run_demo(SCENE, stepper=STEPPER, colour_by=COLOUR_BY, export_fps=EXPORT_FPS, output_dir=OUTPUT_DIR)
