"""The dam break that peers run too: 1 x 1 x 0.5 m of water in a tank of 3 x 2 x 0.5 m, c_s = 12 sqrt(2 g H)."""

import math

import taichi_rts as rts

GRAVITY = 9.81
FRONT_TIME = 0.3  # [s]


def peers_dam_break(cells: int) -> rts.Scene:
    """Return the scene with `cells` particles along 1 m."""
    return rts.load_scene("dam_break").replace(
        name=f"peers_dam_break_{cells}",
        domain=rts.Box(lower=(0, 0, 0), upper=(3, 2, 0.5)),
        fluids=(rts.Block(lower=(0, 0, 0), upper=(1, 1, 0.5)),),
        spacing=1.0 / cells,
        sound_speed=12.0 * math.sqrt(2.0 * GRAVITY),
        end_time=FRONT_TIME,
    )
