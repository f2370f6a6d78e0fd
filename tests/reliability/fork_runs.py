"""Run by `test_forks.py` in environments of their own: python fork_runs.py FILE writes positions of a small dam break."""

import sys

import numpy as np

import taichi_rts as rts

rts.init("cpu", "f64")
found = {}
for stepper in (rts.Uniform(), rts.Regional()):
    sim = rts.Simulation(rts.load_scene("dam_break_2d", particles=400), stepper)
    sim.advance_to(0.05)
    found[stepper.name] = sim.positions()
    found[f"{stepper.name} updates"] = np.array(sim.statistics["particle_updates"])
np.savez(sys.argv[1], **found)
print(rts.ti.__name__)
