"""What the regional sound speed saves, and what it costs in accuracy: the figures of docs/evidence/regional_sound_speed.md.

python studies/regional_sound.py [speed|equal_error|extremes|rule|pool ...] [--particles 100k] [--scenes projectile,...]
speed takes about 15 minutes on 2 idle cores at 100k particles, equal_error as long at 3k, the others a few minutes at their 6k.
"""

import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from tables import head, row

import taichi_rts as rts
from taichi_rts.compare import Settings, compare
from taichi_rts.compare.speedups import at_equal_error
from taichi_rts.readings.extremes import DENSE

SCENES = "projectile,water_jet,dam_break_drop,double_dam_break,martin_moyce"
SAMPLES = 60


@dataclasses.dataclass
class Seen:
    """What a run had at its samples: curves over time, and its costs."""

    height: list[float] = dataclasses.field(default_factory=list)
    kinetic: list[float] = dataclasses.field(default_factory=list)
    mach: list[float] = dataclasses.field(default_factory=list)
    density: list[float] = dataclasses.field(default_factory=list)
    dense: list[float] = dataclasses.field(default_factory=list)
    speed: float = 0.0
    count: int = 0
    updates: int = 0
    wall: float = 0.0
    runaways: int = 0


def run(scene, stepper, samples=SAMPLES):
    """Run `scene` to its end."""
    sim, seen = rts.Simulation(scene, stepper), Seen()
    for time in np.linspace(0.0, scene.end_time, samples + 1)[1:]:
        sim.advance_to(time)
        x, v, rho, _ = sim.state()
        speed = np.linalg.norm(v, axis=1)
        seen.height.append(float(x[:, 1].mean()))
        seen.kinetic.append(sim.energy().kinetic)
        seen.mach.append(float((speed / sim.sound_speeds()).max()))
        seen.density.append(float(rho.max()) / scene.rest_density)
        seen.dense.append(float((rho > DENSE * scene.rest_density).mean()))
        seen.speed = max(seen.speed, float(speed.max()))
    statistics = sim.statistics
    seen.count, seen.updates = sim.count, statistics["particle_updates"]
    seen.wall, seen.runaways = statistics["wall_seconds"], statistics["runaways"]
    return seen


def difference(one, other, scale):
    """Rms difference of two curves over `scale`."""
    return float(np.sqrt(np.mean((np.asarray(one) - np.asarray(other)) ** 2))) / scale


def speed(names: list[str], particles: str, courants: list[float], steppers: str) -> None:
    """Updates and wall time of full runs, against uniform steps with one sound speed.

    Beside the sound speed that the scene estimates that is 10 v_max, v_max being the largest speed that really occurred in the
    uniform run: its costs are those of the uniform run times the ratio of the sound speeds, which is what they are
    proportional to. `capped` is told as much: its cap is 10 v_max, not twenty times the estimate.
    """
    for name in names:
        scene = rts.load_scene(name, particles=particles)
        regional = scene.replace(sound_speed="regional")
        print()
        head(
            "run",
            "λ",
            "updates [M]",
            "saved",
            "at 10 v_max",
            "wall [s]",
            "faster",
            "at 10 v_max",
            "Δy",
            "Δ kinetic",
            "v_max",
            "limited",
        )
        for courant in courants:
            base: Any = None
            for label, where, stepper in (
                ("uniform", scene, rts.Uniform(courant)),
                ("uniform-c", regional, rts.Uniform(courant, adaptive=True)),
                ("regional-c", regional, rts.Regional(courant=courant)),
                ("capped", None, rts.Regional(courant=courant)),
                ("asynchronous-c", regional, rts.Asynchronous(courant=courant)),
            ):
                if label not in steppers.split(","):
                    continue
                if where is None:
                    where = scene.replace(sound_speed=rts.RegionalSound(cap=10.0 * base.speed))
                seen = run(where, stepper, 20)
                base = base or seen
                real = max(1.0, 10.0 * base.speed / scene.wave_speed)
                row(
                    f"{name}, {seen.count:,}: {label}",
                    courant,
                    f"{seen.updates / 1e6:.1f}",
                    f"{base.updates / seen.updates:.2f}x",
                    f"{base.updates * real / seen.updates:.2f}x",
                    f"{seen.wall:.1f}",
                    f"{base.wall / seen.wall:.2f}x",
                    f"{base.wall * real / seen.wall:.2f}x",
                    f"{difference(seen.height, base.height, np.ptp(base.height)):.2%}",
                    f"{difference(seen.kinetic, base.kinetic, max(base.kinetic)):.2%}",
                    f"{seen.speed:.1f}",
                    seen.runaways,
                )


ERRORS = ("centre_of_mass", "kinetic_energy")


def equal_error(names: list[str], particles: str, courants: list[float], steppers: str) -> None:
    """Updates against the best uniform run at equal error.

    Errors are those of `taichi-rts compare`, in the scene's own sound speed. With 10 v_max instead, v_max being the largest
    speed that occurs, the uniform run costs `times` as much, if that is more. (Another sound speed in the scene would be
    another viscosity, too.) What is done is kept in out/equal_error; a second call goes on from there.
    """
    print()
    head("scene, particles", "times at 10 v_max", "run", "updates [M]", *(f"{e}: error | saved" for e in ERRORS))
    for name in names:
        scene = rts.load_scene(name, particles=particles)
        times = max(1.0, 10.0 * run(scene, rts.Uniform()).speed / scene.wave_speed)
        settings = Settings(("uniform", "regional-c"), tuple(courants), repeats=1)
        report = compare(scene, settings, folder=Path("out") / "equal_error" / f"{name}_{particles}")
        alive = [each for each in report["variants"] if each["survived"]]

        def points(error: str, alive: list[dict[str, Any]] = alive) -> list[tuple[float, float]]:
            """Cost and error of all uniform runs."""
            runs = [each for each in alive if each["family"] == "uniform" and each["errors"].get(error)]
            return [(each["costs"]["particle_updates"], each["errors"][error]) for each in runs]

        for each in sorted(alive, key=lambda each: (each["family"], each["costs"]["particle_updates"])):
            updates = each["costs"]["particle_updates"]
            found = []
            for error in ERRORS:
                value = each["errors"][error]
                own = each["family"] == "uniform"
                found.append(f"{value:.2g} | {'-' if own else at_equal_error(points(error), (updates, value))}")
            where = f"{name}, {report['scenes'][0]['particles']:,}"
            row(where, f"{times:.2f}", each["label"], f"{updates / 1e6:.2f}", *found)


def extremes(names: list[str], particles: str, courants: list[float], steppers: str) -> None:
    """Largest Mach numbers and densities over the run."""
    print()
    head(
        "scene",
        "run",
        "largest Mach",
        "largest density: median of samples",
        "99 %",
        "most particles above 1.03",
        "v_max",
    )
    for name in names:
        scene = rts.load_scene(name, particles=particles)
        for label, where, stepper in (
            ("uniform", scene, rts.Uniform(courants[0])),
            ("regional c", scene.replace(sound_speed="regional"), rts.Regional(courant=courants[0])),
        ):
            seen = run(where, stepper, 200)
            row(
                name,
                label,
                f"{max(seen.mach):.3f}",
                f"{np.median(seen.density):.3f}",
                f"{np.percentile(seen.density, 99):.3f}",
                f"{max(seen.dense):.2%}",
                f"{seen.speed:.1f} (estimated {scene.estimate_max_speed():.1f})",
            )


VARIANTS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "as it is": ({}, {}),
    "mach 0.15": ({"mach": 0.15}, {}),
    "memory 5": ({"memory": 5.0}, {}),
    "memory 100": ({"memory": 100.0}, {}),
    "floor 1 m/s": ({"floor": 1.0}, {}),
    "powers of two": ({}, {"steps": "powers_of_two"}),
    "integers": ({}, {"steps": "integers"}),
    "density carried": ({}, {"inactive_density": "extrapolated"}),
    "no limiter": ({}, {"limiter": False}),
}


def rule(names: list[str], particles: str, courants: list[float], steppers: str) -> None:
    """What each part of the rule and of the levels is worth."""
    for name in names:
        scene = rts.load_scene(name, particles=particles)
        print()
        head("variant", "updates saved", "faster", "Δy", "Δ kinetic", "largest density", "limited")
        base = run(scene, rts.Uniform(courants[0]))
        exact = run(scene, rts.Uniform(0.1))
        scale = np.ptp(exact.height)
        for label, seen in [("uniform", base)] + [
            (
                label,
                run(
                    scene.replace(sound_speed=rts.RegionalSound(**sound)), rts.Regional(courant=courants[0], **options)
                ),
            )
            for label, (sound, options) in VARIANTS.items()
        ]:
            row(
                f"{name}: {label}",
                f"{base.updates / seen.updates:.2f}x",
                f"{base.wall / seen.wall:.2f}x",
                f"{difference(seen.height, exact.height, scale):.2%}",
                f"{difference(seen.kinetic, exact.kinetic, max(exact.kinetic)):.2%}",
                f"{max(seen.density):.3f}",
                seen.runaways,
            )


POOL_END = 20.0  # s


def pool(names: list[str], particles: str, courants: list[float], steppers: str) -> None:
    """A pool 1 m deep and wide (2D) in a scene whose cap is 100 m/s: does it lie still, as deep as it should?"""
    spacing, gravity = 0.025, 9.81
    scene = rts.Scene(domain=rts.Box((0, 0), (1, 1.4)), fluids=[rts.Block((0, 0), (1, 1))], spacing=spacing)
    regional = scene.replace(sound_speed=rts.RegionalSound(cap=100.0))
    print()
    quarters = [f"{k * POOL_END / 4:g}-{(k + 1) * POOL_END / 4:g} s" for k in range(4)]
    head(
        "run",
        *(f"kinetic [J], {q}" for q in quarters),
        "depth over predicted, last",
        "pressure error, last",
        "updates [M]",
    )
    for label, where, stepper in (
        ("uniform", scene, rts.Uniform()),
        ("regional-c", regional, rts.Regional()),
        ("asynchronous-c", regional, rts.Asynchronous()),
    ):
        if label not in steppers:
            continue
        sim = rts.Simulation(where, stepper)
        kinetic, depth, pressure = [], [], []
        for time in np.linspace(0.0, POOL_END, 401)[1:]:
            sim.advance_to(time)
            y, p = sim.positions()[:, 1], sim.pressures()
            surface = np.sort(y)[-round(1.0 / spacing) :].mean() + 0.5 * spacing
            compression = gravity * np.clip(1.0 - y, 0.0, 1.0) / sim.sound_speeds() ** 2
            bulk = (y > 0.15) & (y < 0.8)
            kinetic.append(sim.energy().kinetic)
            depth.append(surface / (1.0 - compression.mean()))
            pressure.append(p[bulk].mean() / (scene.rest_density * gravity * (surface - y[bulk].mean())) - 1.0)
        row(
            label,
            *(f"{k:.3g}" for k in np.reshape(kinetic, (4, -1)).mean(axis=1)),
            f"{np.mean(depth[-100:]):.4f}",
            f"{np.mean(pressure[-100:]):+.1%}",
            f"{sim.statistics['particle_updates'] / 1e6:.1f}",
        )


PARTS = {part.__name__: part for part in (speed, equal_error, extremes, rule, pool)}


def main(
    parts: tyro.conf.Positional[tuple[str, ...]] = tuple(PARTS),
    particles: str | None = None,
    scenes: str = SCENES,
    courants: str | None = None,
    steppers: str = "uniform,uniform-c,regional-c,capped,asynchronous-c",
    arch: str = "cpu",
) -> None:
    """Run the parts."""
    rts.init(arch, "f32")
    for part in parts:
        count = particles or {"speed": "100k", "equal_error": "3k"}.get(part, "6k")
        some = courants or ("0.4,0.6,0.8,1.0" if part == "equal_error" else "0.6")
        PARTS[part](scenes.split(","), count, [float(courant) for courant in some.split(",")], steppers)


if __name__ == "__main__":
    sys.exit(tyro.cli(main))
