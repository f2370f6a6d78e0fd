"""What a run leaves behind, bit by bit: python repeat.py ARCH PRECISION STEPPER END_TIME prints digests of it."""

import hashlib
import json
import sys

import taichi_rts as rts

SCENE = rts.Scene(
    domain=rts.Box((0, 0, 0), (1.2, 0.9, 0.6)),
    fluids=[
        rts.Block((0, 0, 0), (0.5, 0.6, 0.6)),
        rts.Block((0.52, 0.2, 0.1), (0.84, 0.6, 0.5), velocity=(-2, -3, 1)),
    ],
    spacing=0.04,
    sound_speed=35.0,
)
"""4000 particles and more blocks than one thread takes at a time, with a collision."""

STEPPERS = {
    "uniform": rts.Uniform(),
    "uniform_adaptive": rts.Uniform(adaptive=True),
    "regional": rts.Regional(),
    "regional_paper": rts.Regional(preset="paper"),
    "regional_sound": rts.Regional(),
    "asynchronous": rts.Asynchronous(),
    "asynchronous_sound": rts.Asynchronous(),
}
END_TIME = 0.03
TIMED = ("wall_seconds", "overhead_fraction")
"""Statistics that a clock has measured."""


def leavings(stepper, end_time=END_TIME):
    """Run to `end_time` [s], and return the bytes of all that can be seen from outside, by name."""
    scene = SCENE.replace(sound_speed="regional") if stepper.endswith("_sound") else SCENE
    sim = rts.Simulation(scene, STEPPERS[stepper], debug=True)
    found = {}
    for time in (0.5 * end_time, end_time):
        sim.advance_to(time)
        names = ("positions", "velocities", "densities", "levels")
        found |= {f"{name} at {time:g} s": each.tobytes() for name, each in zip(names, sim.state(), strict=True)}
        found[f"cell times at {time:g} s"] = sim.cell_times().tobytes()
    counts = {key: value for key, value in sim.statistics.items() if key not in TIMED}
    facts = {"statistics": counts, "energy": sim.energy(), "momentum": sim.momentum().tolist()}
    facts |= {"drift": sim.momentum_drift().tolist(), "sound work": sim.sound_work()}
    return found | {name: json.dumps(value).encode() for name, value in facts.items()}


def main(arch, precision, stepper, end_time):
    rts.init(arch, precision)
    for name, data in leavings(stepper, float(end_time)).items():
        print(hashlib.sha256(data).hexdigest(), name)


if __name__ == "__main__":
    main(*sys.argv[1:])
