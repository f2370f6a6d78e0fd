"""Runs the validation cases and prints the table of docs/evidence/validation.md: python studies/validation.py [case ...].

All of it takes about 12 minutes on 2 cores.
"""

import math
import sys
import time
from pathlib import Path

import taichi_rts as rts
from taichi_rts.device.backend import ti

sys.path.append(str(Path(__file__).parents[1] / "tests" / "validation"))
from cases import CASES, run

STEPPERS = {"uniform": rts.Uniform(), "regional": rts.Regional(), "asynchronous": rts.Asynchronous()}


ROUNDING = 1e-12


def order(errors, spacings):
    """Observed order of convergence in space, as text; none where the errors are rounding or change their sign."""
    first, second = errors
    if first * second <= 0.0 or max(abs(first), abs(second)) < ROUNDING:
        return ""
    return f" ({math.log(first / second) / math.log(spacings[0] / spacings[1]):.1f})"


def measure(case):
    """Errors of each stepper at each spacing."""
    found = {}
    for name, stepper in STEPPERS.items():
        if name == "uniform" or case.all_steppers:
            found[name] = []
            for spacing in case.spacings:
                rts.init("cpu", "f64", restart=True)
                found[name].append(run(case, stepper, spacing)[0])
                ti.reset()
    return found


def rows(name, case):
    """Print a row for each of a case's errors."""
    found = measure(case)
    for error in found["uniform"][0]:
        cells = [f"{name}: {error}", " → ".join(f"{spacing:.3g}" for spacing in case.spacings)]
        for stepper in STEPPERS:
            both = [result[error] for result in found.get(stepper, [])]
            cells.append(f"{both[0]:.2g} → {both[1]:.2g}{order(both, case.spacings)}" if both else "")
        print("| " + " | ".join([*cells, case.peers.get(error, "")]) + " |", flush=True)


if __name__ == "__main__":
    began = time.perf_counter()
    print("| case: error | spacing [m] | " + " | ".join(STEPPERS) + " | peer |\n" + "|---" * 6 + "|")
    for chosen in sys.argv[1:] or CASES:
        rows(chosen, CASES[chosen])
    print(f"\n{time.perf_counter() - began:.0f} s")
