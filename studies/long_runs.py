"""Runs of 200,000 base steps: python studies/long_runs.py [--steps 200000] [--only pool] [--output out/long_runs.json].

A pool at rest, and a tank that is tilted to and fro, with each stepper: is energy bounded, are mass, momentum and ticks kept, is
memory flat? Prints a table (docs/evidence/reliability.md). Each row is a process of its own and is written as soon as it is
done; a second call goes on with those that are missing.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from tables import head, row

import taichi_rts as rts
from taichi_rts.files.writing import write_json

SAMPLES = 20
TANK = {"domain": rts.Box((0, 0), (0.6, 0.5)), "spacing": 0.03, "fluids": [rts.Block((0, 0), (0.6, 0.24))]}
TILT, PERIOD = 1.0, 1.1  # [m/s^2], [s]: near the first mode of the tank, so that it sloshes hard


def tilts(end):
    """Gravity that leans to one side and to the other."""
    times = np.arange(PERIOD / 2, end, PERIOD / 2)[:900]
    return [rts.GravityChange(float(t), (TILT * (-1) ** k, -9.81)) for k, t in enumerate(times)]


SCENES = {
    "pool": lambda end: rts.Scene(**TANK, hydrostatic=True, sound_speed=22.0),
    "sloshing": lambda end: rts.Scene(**TANK, hydrostatic=True, sound_speed=22.0, gravity_changes=tilts(end)),
}
STEPPERS = {
    "uniform": rts.Uniform(),
    "regional": rts.Regional(),
    "asynchronous": rts.Asynchronous(),
    "regional-c": rts.Regional(),
}
"""regional-c has a regional sound speed."""


def resident():
    """Memory [MiB] of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def run(scene_name, stepper, steps):
    """Make one run, and return what came of it."""
    rts.init("cpu", "f64", cpu_max_num_threads=1)
    tick = STEPPERS[stepper].timeline(SCENES[scene_name](1.0)).tick
    scene = SCENES[scene_name](steps * tick)
    scene = scene.replace(sound_speed="regional") if stepper.endswith("-c") else scene
    # A debug run adds up what changes of the sound speed do.
    sim = rts.Simulation(scene, STEPPERS[stepper], debug=scene.regional_sound is not None)
    end = (steps + 0.5) * sim.base_step
    first, count = sim.energy(), sim.count
    flow = first.potential  # what could become motion
    gain, kinetic, momentum, memory, left = [], [], [], [], 0
    for k, time in enumerate(np.linspace(0.0, end, SAMPLES + 1)[1:], 1):
        sim.advance_to(time)
        energy, x = sim.energy(), sim.positions()
        gain.append((energy.total - sim.work() - sim.sound_work() - first.total) / flow)
        kinetic.append(energy.kinetic / flow)
        momentum.append(sim.momentum() / (count * sim.medium.mass * np.sqrt(9.81 * 0.24)))
        left += int(((x < scene.domain.lower) | (x > scene.domain.upper)).any(axis=1).sum())
        memory += [resident()] if k in (SAMPLES // 10, SAMPLES) else []
    half = SAMPLES // 2
    return {
        "scene": scene_name,
        "stepper": stepper,
        "particles": count,
        "base_steps": sim.statistics["base_steps"],
        "time": end,
        "largest gain of energy": max(gain),
        "kinetic energy, first half": max(kinetic[:half]),
        "kinetic energy, second half": max(kinetic[half:]),
        "mean momentum": np.abs(np.mean(momentum, axis=0)).tolist(),
        "particles lost": count - sim.count + left,
        "ticks": sim.timeline.now,
        "ticks times tick less time, in ticks": sim.timeline.now - end / sim.timeline.tick,
        "runaways": sim.statistics["runaways"],
        "density": [float(each) / 1000.0 for each in np.percentile(sim.densities(), (0, 50, 100))],
        "memory at 10 % [MiB]": memory[0],
        "memory at the end [MiB]": memory[1],
        "wall_seconds": sim.statistics["wall_seconds"],
    }


def show(found):
    head(
        "scene",
        "stepper",
        "time",
        "energy gained",
        "kinetic, 1st half, 2nd half",
        "mean momentum x, y",
        "lost",
        "MiB at 10 %, at the end",
    )
    for each in found.values():
        row(
            each["scene"],
            each["stepper"],
            f"{each['time']:.0f} s",
            f"{each['largest gain of energy']:.2e}",
            f"{each['kinetic energy, first half']:.1e}, {each['kinetic energy, second half']:.1e}",
            ", ".join(f"{value:.1e}" for value in each["mean momentum"]),
            each["particles lost"],
            f"{each['memory at 10 % [MiB]']:.0f}, {each['memory at the end [MiB]']:.0f}",
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=200_000)
    parser.add_argument("--only", default="", help="scenes, steppers, parted by commas")
    parser.add_argument("--output", type=Path, default=Path("out/long_runs.json"))
    parser.add_argument("--row", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        print(json.dumps(run(*options.row, options.steps)))
        return
    found = json.loads(options.output.read_text()) if options.output.exists() else {}
    for stepper in STEPPERS:
        for scene in SCENES:
            key = f"{scene} {stepper} {options.steps}"
            if key in found or (options.only and not {scene, stepper} & set(options.only.split(","))):
                continue
            command = [sys.executable, __file__, "--steps", str(options.steps), "--row", scene, stepper]
            made = subprocess.run(command, capture_output=True, text=True)
            if made.returncode:
                print(f"{key} failed: {made.stderr.strip().splitlines()[-1]}", file=sys.stderr)
                continue
            found[key] = json.loads(made.stdout.splitlines()[-1])
            write_json(options.output, found)
    show(found)


if __name__ == "__main__":
    main()
