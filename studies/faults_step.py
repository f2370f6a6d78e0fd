"""Half of a fault (`faults.py`): `save` stops a simulation between two steps, saves it and goes on; `load` takes it up.

Both print a digest of all that can be seen at the end.
"""

import hashlib
import json
import sys

import taichi_rts as rts

SCENE = rts.Scene(
    domain=rts.Box((0, 0), (1, 1)),
    fluids=[
        rts.Block((0, 0), (1, 0.3)),
        rts.Block((0.3, 0.4), (0.6, 0.7), velocity=(0, -3), kinematic_viscosity=0.01),
    ],
    spacing=0.05,
    sound_speed="regional",
    gravity_changes=[rts.GravityChange(0.03, (1.0, -9.0))],
    moving_walls=[rts.MovingWall("x-", (0.0, 0.5), (0.0, 0.3))],
    inflows=[rts.Inflow((0.4, 1.0), (0.6, 1.0), (0, -4), stop=0.06)],
    obstacles=[rts.BoxObstacle((0.75, 0.35), (0.9, 0.5), motion=rts.ConstantMotion((0, -1)))],
)
STEPPERS = {
    "uniform": rts.Uniform(adaptive=True),
    "regional": rts.Regional(),
    "asynchronous": rts.Asynchronous(steps="integers", stagger=1),
}


def main(part, stepper, precision, path):
    rts.init("cpu", precision)
    if part == "save":
        sim = rts.Simulation(SCENE, STEPPERS[stepper], debug=True)
        sim.advance_to(0.0213)
        asked = iter([False, False, True])
        sim.stop_asked = lambda: next(asked)
        try:
            sim.advance_to(0.05)
        except rts.errors.Interrupted:
            rts.save_checkpoint(sim, path)
        sim.stop_asked = lambda: False
    else:
        sim = rts.load_checkpoint(path)
    sim.advance_to(0.08)
    facts = {key: value for key, value in sim.statistics.items() if key not in ("wall_seconds", "overhead_fraction")}
    facts |= {"energy": sim.energy(), "count": sim.count, "work": sim.work(), "ticks": sim.timeline.now}
    seen = b"".join(array.tobytes() for array in sim.state()) + json.dumps(facts).encode()
    print(hashlib.sha256(seen).hexdigest())


if __name__ == "__main__":
    main(*sys.argv[1:])
