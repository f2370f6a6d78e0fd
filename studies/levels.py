"""Every combination of levels, steps, grading, limiter and sound speed of `Regional` in a small impact: the table of
docs/evidence/stability.md.

python studies/levels.py: each as a debug run, in which no particle may be late; about 40 minutes on 2 cores. What is
done is kept in out/levels.json; a second call goes on from there.
"""

import json
import sys
from multiprocessing import get_context
from pathlib import Path

from tables import head, row

import taichi_rts as rts

sys.path.append(str(Path(__file__).parents[1] / "tests" / "conformance"))
from combinations import ALL, LEVELS, STEPS, drop_on_pool
from combinations import run as run_scene

KEPT = Path("out") / "levels.json"


def measure(combination):
    """Energy over the start's, density over rest and updates; a text where the run failed."""
    rts.init("cpu", "f32", restart=True, advanced_optimization=False)
    try:
        energy, density, updates = run_scene(combination.of(drop_on_pool()), combination.stepper)
    except (AssertionError, rts.Error) as error:
        return str(combination), f"{type(error).__name__}: {error}"
    return str(combination), [float(energy), float(density), int(updates)]


def main():
    """Run what is missing, and print the largest energy, and the updates, over the four settings of grading and limiter."""
    KEPT.parent.mkdir(exist_ok=True)
    found = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    with get_context("spawn").Pool(2, maxtasksperchild=20) as pool:
        for name, result in pool.imap(measure, [each for each in ALL if str(each) not in found]):
            found[name] = result
            KEPT.write_text(json.dumps(found, indent=1))
    failed = {name: result for name, result in found.items() if isinstance(result, str)}
    head("levels", *(f"{steps}{sound}" for sound in ("", ", regional sound") for steps in STEPS))
    for levels in LEVELS:
        cells = []
        for by_sound in (False, True):
            for steps in STEPS:
                same = [c for c in ALL if (c.levels, c.steps, c.by_sound) == (levels, steps, by_sound)]
                rows = [found[str(c)] for c in same if str(c) not in failed]
                updates = [each[2] / 1e3 for each in rows]
                cells.append(
                    f"{max(each[0] for each in rows):.4f}, {min(updates):.1f}-{max(updates):.1f}k" if rows else "-"
                )
        row(levels, *cells)
    rows = [result for name, result in found.items() if name not in failed]
    print(
        f"{len(rows)} of {len(ALL)} ran; largest energy {max(r[0] for r in rows):.4f}, density {max(r[1] for r in rows):.4f}"
    )
    for name, why in failed.items():
        print(f"{name}: {why}")


if __name__ == "__main__":
    main()
