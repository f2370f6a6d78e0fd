"""Invariants of every scene with every stepper against the stored ones: python studies/invariants.py [--write].

Prints what has changed, exit code 1 if something has; `--write` stores the new values (tests/reliability/invariants.json).
"""

import argparse
import sys
from pathlib import Path

import taichi_rts as rts

sys.path.append(str(Path(__file__).parents[1] / "tests" / "reliability"))
import stored_invariants as invariants


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="store what is found")
    parser.add_argument("--only", default="", help="scenes, parted by commas")
    parser.add_argument("--precision", default="f64", help="f32 shows what rounding does")
    options = parser.parse_args()
    kept = invariants.read()
    changed = 0
    for scene in options.only.split(",") if options.only else invariants.names():
        for stepper in invariants.STEPPERS:
            key = f"{scene} {stepper}"
            rts.init("cpu", options.precision, restart=True, advanced_optimization=False)
            found = invariants.measure(invariants.small(scene), stepper)
            said = invariants.differences(found, kept[key]) if key in kept else ["new"]
            print(f"{key}: {'; '.join(said) or 'the same'}", flush=True)
            changed += bool(said)
            if options.write:
                kept[key] = found
                invariants.write(kept)
    raise SystemExit(bool(changed) and not options.write)


if __name__ == "__main__":
    main()
