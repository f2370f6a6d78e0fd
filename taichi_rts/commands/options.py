"""Groups of the options of `taichi-rts run`; those of pictures are `PictureOptions` itself."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, Literal

import tyro

import taichi_rts as rts
from taichi_rts.output.export import DEFAULT_ATTRIBUTES
from taichi_rts.output.turning import UpAxis
from taichi_rts.rendering.painter import PictureOptions
from taichi_rts.solver.stepping.steppers import STEPPERS, StepperName

DEFAULT_SCENE = "double_dam_break"


@dataclasses.dataclass(frozen=True)
class SceneOptions:
    """What is simulated."""

    scene: tyro.conf.Positional[str | None] = None
    """Name of a built-in scene (see `taichi-rts scenes`) or path of a TOML or SPlisHSPlasH file; by default double_dam_break."""
    spacing: float | None = None
    """Initial particle spacing [m]."""
    particles: str | None = None
    """Number of fluid particles instead of a spacing, e.g. 30k or 1.5M."""
    sound_speed: float | Literal["regional", "auto"] | None = None
    """Sound speed [m/s], or regional, or auto; by default ten times the largest speed the scene suggests."""
    end_time: float | None = None
    """Physical time to run to [s]; by default the scene's own."""

    def load(self) -> rts.Scene:
        """Load the scene that the options describe."""
        changes = {key: getattr(self, key) for key in ("spacing", "sound_speed", "end_time")}
        changes = {key: value for key, value in changes.items() if value is not None}
        return rts.load_scene(self.scene or DEFAULT_SCENE, particles=self.particles, **changes)


@dataclasses.dataclass(frozen=True)
class StepperOptions:
    """How it steps: the parameters of all steppers. What is left out has its stepper's own default."""

    stepper: StepperName | None = None
    """One step for all, a step for each block, or a time for each block; by default regional."""
    preset: Literal["paper"] | None = None
    """Regional: the paper's setting (courant 0.4, 3 levels, Eq. 1 not enforced beyond level 1)."""
    courant: float | None = None
    """Courant number dt c_s / r of the base step; asynchronous: of the longest step."""
    levels: int | None = None
    """Regional, asynchronous: largest number of base steps in a step."""
    alpha: float | None = None
    """Regional: alpha of Eq. 3."""
    lambda_f: float | None = None
    """Regional, asynchronous, adaptive uniform: factor of the force limit, Eq. 2."""
    strict_cfl: bool | None = None
    """Regional: divide the base step by the number of levels, so that the longest step respects Eq. 1."""
    grading: bool | None = None
    """Regional: let levels of neighbouring blocks differ by at most one."""
    corrector: bool | None = None
    """Regional: Serna's corrector. Without it the method blows up."""
    inactive_density: Literal["stale", "extrapolated"] | None = None
    """Regional, asynchronous: density of particles that are not due."""
    steps: Literal["powers_of_two", "half_octaves", "integers"] | None = None
    """Regional, asynchronous: lengths that steps may have, in base steps; half_octaves (1, 2, 3, 4, 6 ...) only regional."""
    limiter: bool | None = None
    """Regional, asynchronous: bound a block's step by its neighbours' and by its last, and wake neighbours."""
    stagger: int | None = None
    """Asynchronous: seed of random first steps, so that all blocks have different ages."""
    integrator: Literal["serna", "symplectic_euler"] | None = None
    """Uniform: how to integrate."""
    adaptive: bool | None = None
    """Uniform: follow the largest speed and acceleration."""

    def parameters(self) -> dict[str, Any]:
        """Return the steppers' parameters that were given, in alphabetical order."""
        return {key: value for key, value in sorted(vars(self).items()) if key != "stepper" and value is not None}

    def make(self) -> Any:
        """Build the stepper; raises `StepperError` if a parameter does not belong to it."""
        name = self.stepper or rts.Regional.name
        kind, given = STEPPERS[name], self.parameters()
        if foreign := sorted(set(given) - {field.name for field in dataclasses.fields(kind)}):
            raise rts.StepperError(f"{flags(foreign)} does not belong to the {name} stepper; leave it out")
        return kind(**given)


@dataclasses.dataclass(frozen=True)
class FileOptions:
    """What is written, and where."""

    export_fps: float = 60.0
    """Frames per second of physical time."""
    output_dir: Path | None = None
    """Folder for the results; by default out/SCENE."""
    overwrite: bool = False
    """Replace an earlier run's frames, video and run.json in the output folder."""
    checkpoint_every: float | None = None
    """Write a checkpoint to OUTPUT_DIR/checkpoints every so many physical seconds [s], and at the end (docs/restart.md)."""
    video: bool = False
    """Also write video.mp4 (needs the extra `video`)."""
    gif: bool = False
    """Also write video.gif, of at most 640 pixels across and 25 frames a second."""
    frames: bool = True
    """Write pictures; --no-frames for a run that only writes files."""
    export: tuple[str, ...] = ()
    """Also write particles at each frame, in any of vtu, ply, npz, bgeo, vtkhdf, and the water's surface (docs/files.md)."""
    attributes: tuple[str, ...] = DEFAULT_ATTRIBUTES
    """What files say of each particle: any of id, velocity, density, pressure, level, step, cell_time, sound_speed, fluid."""
    up: UpAxis | None = None
    """Turn what --export writes so that this axis is up, against gravity: z for Blender, y for Houdini."""


SWITCHED_ON = {
    field.name
    for group in (FileOptions, PictureOptions)
    for field in dataclasses.fields(group)
    if field.default is True
}
"""Options that are given only to switch something off."""


def flags(names: list[str]) -> str:
    """Return options as a user writes them."""
    return ", ".join(f"--{'no-' if name in SWITCHED_ON else ''}{name.replace('_', '-')}" for name in names)
