"""Does stepping in regions beat the best uniform step, scene by scene? Prints the table of docs/evidence/verdicts.md.

python studies/verdicts.py [scene ...] runs `taichi-rts compare --repeats 1` at its default size on every built-in scene:
a few minutes a scene on 2 cores. Costs are particle updates, which do not depend on what else the machine does. What is done is
kept in out/verdicts; a second call goes on from there.
"""

import sys
from pathlib import Path

from tables import head, row

import taichi_rts as rts
from taichi_rts.compare import Settings, analyse, compare
from taichi_rts.compare.command import Compare
from taichi_rts.compare.speedups import cost_at

FOLDER = Path("out") / "verdicts"
FAMILIES = ("regional", "paper", "asynchronous")


def best(report, family):
    """Return gain in updates over the best uniform run at equal error, and label and error, of a family's best run, as text."""
    points = [
        (run["label"], run["costs"]["particle_updates"], run["errors"]["velocities"], run["family"])
        for run in report["variants"]
        if run["survived"] and run["errors"].get("velocities")
    ]
    uniform = [(cost, error) for _, cost, error, kind in points if kind == "uniform"]
    found = []
    for label, own, error, kind in points:
        baseline, bound = cost_at(uniform, error)
        if kind == family and baseline is not None:
            short = label.removeprefix(f"{family} ")
            found.append((baseline / own, f"{baseline / own:.2f}{'*' if bound else ''} ({short}, {error:.2g})"))
    return max(found, default=(0, "-"))[1]


def cells(name):
    """Return the cells of a scene's row."""
    scene = Compare(scene=name).load()
    report = analyse(compare(scene, Settings(repeats=1), folder=FOLDER / name), "velocities", "updates")
    ground, stable = report["scenes"][0], report["largest_stable"][0]
    floor = ground["floor"]["velocities"]
    limit = "-" if stable["stable"] is None else f"{stable['stable']:.2g}"
    return [name, ground["particles"], f"{ground['parting_time']:.3g}", f"{floor or 0:.1g}", limit] + [
        best(report, family) for family in FAMILIES
    ]


if __name__ == "__main__":
    head("scene", "particles", "t_p [s]", "floor", "uniform survives to λ", *FAMILIES)
    comparable = [name for name in rts.scene_names() if not rts.load_scene(name).outlets]  # others lose particles
    for scene_name in sys.argv[1:] or comparable:
        row(*cells(scene_name))
