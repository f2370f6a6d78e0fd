"""Does stepping in regions beat the best uniform step, scene by scene? Prints the table of docs/compare.md.

python tests/benchmarks/verdicts.py [scene ...] runs `taichi-rts compare` at its default size on every built-in scene and on
all its defaults: about 3 minutes a scene on 2 cores. What is done is kept in out/verdicts; a second call goes on from there.
"""

import sys
from pathlib import Path

import taichi_rts as rts
from taichi_rts.compare import Settings, analyse, compare
from taichi_rts.compare.command import Compare
from taichi_rts.compare.speedups import cost_at

FOLDER = Path("out") / "verdicts"


def best(report, family, cost):
    """Return label and gain over the best uniform run at equal error of a family's best run, as text."""
    key = {"wall": "wall_seconds", "updates": "particle_updates"}[cost]
    points = {
        run["label"]: (run["costs"][key], run["errors"]["velocities"], run["family"])
        for run in report["variants"]
        if run["survived"] and run["errors"].get("velocities")
    }
    uniform = [point[:2] for point in points.values() if point[2] == "uniform"]
    found = []
    for label, (own, error, kind) in points.items():
        baseline, bound = cost_at(uniform, error)
        if kind == family and baseline is not None:
            found.append((baseline / own, f"{baseline / own:.2f}{'*' if bound else ''} ({label}, {error:.2g})"))
    return max(found, default=(0, "-"))[1]


def row(name):
    """Return the cells of a scene's row."""
    scene = Compare(scene=name).load()
    report = analyse(compare(scene, Settings(), folder=FOLDER / name), "velocities", "updates")
    ground, stable = report["scenes"][0], report["largest_stable"][0]
    floor = ground["floor"]["velocities"]
    gains = [best(report, family, cost) for family in ("regional", "asynchronous") for cost in ("updates", "wall")]
    limit = "-" if stable["stable"] is None else f"{stable['stable']:.2g}"
    return [name, ground["particles"], f"{ground['parting_time']:.3g}", f"{floor or 0:.1g}", limit, *gains]


if __name__ == "__main__":
    heads = ["scene", "particles", "t_p [s]", "floor", "uniform stable to λ"]
    heads += ["regional, by updates", "by time", "asynchronous, by updates", "by time"]
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|", flush=True)
    for scene_name in sys.argv[1:] or rts.scene_names():
        print("| " + " | ".join(map(str, row(scene_name))) + " |", flush=True)
