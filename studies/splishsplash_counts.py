"""How many particles SPlisHSPlasH itself makes of a scene: `python splishsplash_counts.py SCENE.json` prints them as JSON.

A process of its own, since pysplishsplash ends it if it cannot make something. It takes one step of a copy of the scene that
has particles as boundaries, not maps, so that they can be counted. Where importing it ends in a segmentation fault, its own
copy of libGLX collides with the system's, and `LD_PRELOAD=/lib/x86_64-linux-gnu/libGLX.so.0` helps.
"""

import json
import os
import sys
import tempfile
from pathlib import Path


def copy_with_particles(scene: Path, folder: Path) -> Path:
    """Write a copy of `scene` with Akinci's boundary particles into `folder`, the files it names in their places."""
    data = json.loads(scene.read_text())
    data.setdefault("Configuration", {})["boundaryHandlingMethod"] = 0
    (folder / "models").symlink_to(scene.parent.parent / "models")
    (folder / "Scenes").mkdir()
    copy = folder / "Scenes" / scene.name
    copy.write_text(json.dumps(data))
    for script in scene.parent.glob("*.py"):
        (copy.parent / script.name).symlink_to(script)
    return copy


def count(scene: Path) -> None:
    """Print {"fluid": N, "bodies": [M, ...]}: particles of all fluids and of each body in the order of the scene's."""
    import pysplishsplash as sph

    folder = Path(tempfile.mkdtemp())
    base = sph.Exec.SimulatorBase()
    base.init(
        useGui=False,
        useCache=False,
        sceneFile=str(copy_with_particles(scene, folder)),
        outputDir=str(folder / "out"),
        stopAt=1.0,
        initialPause=False,
    )
    base.initSimulation()

    def look() -> None:
        sim = sph.Simulation.getCurrent()
        fluid = sum(sim.getFluidModel(k).numActiveParticles() for k in range(sim.numberOfFluidModels()))
        bodies = [sim.getBoundaryModel(k).numberOfParticles() for k in range(sim.numberOfBoundaryModels())]
        print("COUNTS", json.dumps({"fluid": fluid, "bodies": bodies}), flush=True)
        os._exit(0)

    base.setTimeStepCB(look)
    base.runSimulation()


if __name__ == "__main__":
    count(Path(sys.argv[1]).resolve())
