"""A block of water hits a still pool at 20 m/s: every region has the sound speed that its own flow needs.

Takes every option of `taichi-rts run`, e.g. --arch cuda --particles 1M --stepper asynchronous --colour-by level.
"""

from taichi_rts.commands.main import run_demo

SCENE = "projectile"
SOUND_SPEED = "regional"
COLOUR_BY = "sound"
EXPORT_FPS = 200.0  # frames per second of physical time

if __name__ == "__main__":
    run_demo(SCENE, sound_speed=SOUND_SPEED, colour_by=COLOUR_BY, export_fps=EXPORT_FPS)
