"""Whether threads with a core each pay: python studies/pinning.py [--pairs 5] [--load 0].

Runs a two-dimensional dam break in pairs of processes, pinned and free, in turns, and prints the median time of an update and
that of the pairs' ratios, with the load average beside it. `--load N` keeps N other processes busy meanwhile.
"""

import argparse
import os
import statistics
import subprocess
import sys

RUN = """
import sys, taichi_rts as rts
rts.init("cpu", "f32")
sim = rts.Simulation(rts.load_scene("dam_break_2d", particles=sys.argv[1]), rts.Uniform())
sim.advance_to(0.02)
before = sim.statistics
sim.advance_to(float(sys.argv[2]))
after = sim.statistics
updates = after["particle_updates"] - before["particle_updates"]
print(1e9 * (after["wall_seconds"] - before["wall_seconds"]) / updates)
"""
BUSY = "while True: pass"


def nanoseconds(pin, particles, until):
    """Time of an update [ns] in a process of its own; `pin` is TAICHI_RTS_PIN, None: by the rule."""
    environment = {name: value for name, value in os.environ.items() if name != "TAICHI_RTS_PIN"}
    environment |= {} if pin is None else {"TAICHI_RTS_PIN": pin}
    command = [sys.executable, "-c", RUN, particles, str(until)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout)


def main():
    """Run the pairs and print them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--load", type=int, default=0, help="other processes that are kept busy")
    parser.add_argument("--particles", default="10k")
    parser.add_argument("--until", type=float, default=0.1, help="physical time [s]")
    options = parser.parse_args()
    others = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(options.load)]
    found = {"pinned": [], "free": [], "by the rule": []}
    try:
        for pair in range(options.pairs):
            order = [("pinned", "1"), ("free", "0"), ("by the rule", None)]
            for name, pin in order if pair % 2 == 0 else order[::-1]:
                found[name].append(nanoseconds(pin, options.particles, options.until))
            said = ", ".join(f"{name} {times[-1]:.0f} ns" for name, times in found.items())
            print(f"{said}; load average {os.getloadavg()[0]:.1f}", flush=True)
    finally:
        for other in others:
            other.kill()
    for name, times in found.items():
        ratios = [time / free for time, free in zip(times, found["free"], strict=True)]
        print(f"{name}: median {statistics.median(times):.0f} ns an update, {statistics.median(ratios):.2f} of free")


if __name__ == "__main__":
    main()
