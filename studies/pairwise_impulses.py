"""Do pairwise impulses at borders between levels pay? The figures of docs/evidence/pairwise_impulses.md.

python studies/pairwise_impulses.py [dams|dams_3d|impact|dams_sound|impact_sound|pool|drop ...] [default|paper|many ...]
takes about 20 minutes on 2 cores.

The variant is in impulse_motion.py. Every setting runs as it is and with it, with densities of the last evaluation ("stale") and
extrapolated ones, beside `Uniform` with a step of a quarter of the default base step. Everything is in double precision.
"""

import sys

import numpy as np
from impulse_motion import drift_with_owed, pairwise_impulses

import taichi_rts as rts
from taichi_rts.compare.measures import Yardstick, centre_of_mass, kinetic_energy, parting, velocities
from taichi_rts.compare.trajectory import Trajectory
from taichi_rts.scene.near_pairs import near_pairs

COLUMNS = [
    "stepper",
    "λ_f",
    "density",
    "pairs",
    "updates [k]",
    "partial [k]",
    "drift",
    "owed",
    "energy",
    "kinetic",
    "centre",
    "v",
]
COLUMNS += ["noise", "share of updates by level"]


def impact(sound_speed):
    """A block at 20 m/s into a pool, in two dimensions: `projectile` for a few hundred particles."""
    block = rts.Block(lower=(0.4, 0.6), upper=(0.6, 0.8), velocity=(0.0, -20.0))
    pool = rts.Block(lower=(0.0, 0.0), upper=(1.0, 0.5))
    domain = rts.Box(lower=(0.0, 0.0), upper=(1.0, 1.2))
    return rts.Scene(name="impact", spacing=0.025, domain=domain, fluids=(pool, block), sound_speed=sound_speed)


STEPPERS = {
    "default": lambda **o: rts.Regional(**o),
    "many": lambda **o: rts.Regional(courant=0.1, levels=6, steps="integers", **o),
    "paper": lambda **o: rts.Regional(preset="paper", **o),
}
"""What is compared, as functions of lambda_f and the rest."""


SCENES = {
    "dams": (lambda: rts.load_scene("double_dam_break_2d", spacing=0.04), 1.0, 1.0, 50),
    "dams_3d": (lambda: rts.load_scene("double_dam_break", spacing=0.08), 1.0, 1.0, 25),
    "impact": (lambda: impact(40.0), 0.1, None, 25),
    "dams_sound": (lambda: rts.load_scene("double_dam_break_2d", spacing=0.04, sound_speed="regional"), 1.0, 1.0, 25),
    "impact_sound": (lambda: impact("regional"), 0.1, None, 25),
}
"""Scene, end time [s], H [m] of the scale m sqrt(gH) of momentum (None: the scale is the momentum of the block), samples."""


def noise(x, rho, support, rest):
    """How much densities differ from the mean over their neighbours, rms over particles that are not at the surface."""
    total, number = np.zeros(len(x)), np.zeros(len(x))
    for i, j, _ in near_pairs(x, support):
        total += np.bincount(i, rho[j], len(x))
        number += np.bincount(i, minlength=len(x))
    inside = rho > 0.98 * rest
    return float(np.sqrt(np.mean((rho - total / number)[inside] ** 2)) / rest) if inside.any() else 0.0


class Run:
    """What a run had at its samples."""

    def __init__(self, name, stepper, impulses=False, position="impulse"):
        make, end_time, height, samples = SCENES[name]
        scene = make()
        with pairwise_impulses(position, on=impulses):
            sim = rts.Simulation(scene, stepper, debug=True)
        self.scene, self.path = scene, Trajectory()
        self.drift, self.owed, self.noise = [], [], []
        scale = sim.medium.mass * sim.count * np.sqrt(9.81 * (height or 1.0))
        if height is None:
            scale = np.linalg.norm(sim.momentum())
        for time in np.linspace(0.0, end_time, samples + 1):
            sim.advance_to(time)
            x, v, rho, _ = sim.state()
            self.path.append(time, x, v, rho, sim.pressures(), sim.energy())
            self.drift.append(np.linalg.norm(sim.momentum_drift()) / scale)
            self.owed.append(np.linalg.norm(drift_with_owed(sim)) / scale if impulses else np.nan)
            self.noise.append(noise(x, rho, scene.support, scene.rest_density))
        seen = sim.statistics
        self.updates, self.partial = seen["particle_updates"], int(sim.motion.partial_updates[None]) if impulses else 0
        self.lost = seen["runaways"] > 0
        self.energy = np.array([sum(energy) for energy in self.path.energies])
        self.levels = [round(share, 2) for share in seen["update_fractions"]]

    def cells(self, reference, scale, together):
        """The row's numbers: work, drift, errors against `reference`, noise."""
        if self.lost:
            return [f"{self.updates / 1e3:.0f}", f"{self.partial / 1e3:.0f}", "blown up", *[""] * 6]
        gain = np.sqrt(np.mean(((self.energy - reference.energy) / reference.energy[0])[1:] ** 2))
        last = (self.energy[-1] - reference.energy[-1]) / reference.energy[0]
        measures = [
            measure(self.path, reference.path, scale, together)
            for measure in (kinetic_energy, centre_of_mass, velocities)
        ]
        return [
            f"{self.updates / 1e3:.0f}",
            f"{self.partial / 1e3:.0f}",
            f"{max(self.drift):.1e}",
            "" if np.isnan(self.owed[-1]) else f"{max(self.owed):.0e}",
            f"{gain:.4f} ({last:+.4f})",
            *("-" if value is None else f"{value:.4f}" for value in measures),
            f"{np.mean(self.noise[1:]):.5f}",
        ]


def show(*cells):
    """Print one row of a table."""
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def table(name, chosen):
    """Print the table of one scene, with the `chosen` settings."""
    sound = name.endswith("_sound")
    uniform = {f"uniform {c:g}": rts.Uniform(courant=c, adaptive=sound) for c in (0.05, 0.1, 0.4, 0.6)}
    runs = {label: Run(name, stepper) for label, stepper in uniform.items()}
    reference, coarser = runs["uniform 0.05"], runs["uniform 0.1"]
    scale = Yardstick.of(reference.scene, reference.path)
    together = parting(coarser.path, reference.path)
    print(f"\n{name}: {len(reference.path.positions[0])} particles, t_p = {reference.path.times[together]:g} s\n")
    show(*COLUMNS)
    show(*["---"] * len(COLUMNS))
    for label, run in runs.items():
        show(label, "", "", "", *run.cells(reference, scale, together))
    for label in ["default"] if sound else chosen:
        make = STEPPERS[label]
        for lambda_f in (0.1, 0.25):
            for density in ("stale", "extrapolated"):
                stepper = make(lambda_f=lambda_f, inactive_density=density)
                for pairs in ("own", "impulses"):
                    run = Run(name, stepper, pairs == "impulses")
                    show(label, lambda_f, density, pairs, *run.cells(reference, scale, together), run.levels)


def pool(chosen):
    """How calm a pool in two dimensions stays that rests: rms speed over sqrt(gH) from 2 to 3 s."""
    block, domain = rts.Block(lower=(0.0, 0.0), upper=(1.0, 0.5)), rts.Box(lower=(0.0, 0.0), upper=(1.0, 1.0))
    scene = rts.Scene(name="pool", spacing=0.025, domain=domain, fluids=(block,))
    print("\npool\n")
    show("stepper", "λ_f", "density", "own pairs", "impulses", "updates [k], own", "impulses")
    show(*["---"] * 7)
    for label in chosen:
        make = STEPPERS[label]
        for lambda_f in (0.1, 0.25):
            for density in ("stale", "extrapolated"):
                speeds, work = [], []
                for impulses in (False, True):
                    with pairwise_impulses(on=impulses):
                        sim = rts.Simulation(scene, make(lambda_f=lambda_f, inactive_density=density))
                    seen = []
                    for time in np.linspace(2.0, 3.0, 21):
                        sim.advance_to(time)
                        seen.append((sim.velocities() ** 2).sum(axis=1).mean())
                    speeds.append(f"{np.sqrt(np.mean(seen) / (9.81 * 0.5)):.5f}")
                    work.append(f"{sim.statistics['particle_updates'] / 1e3:.0f}")
                show(label, lambda_f, density, *speeds, *work)


def drop(_chosen):
    """Error and order of a smooth flow without walls, `oscillating_drop`: velocities at 0.3 s, as in convergence.py."""
    scene, courants = rts.load_scene("oscillating_drop", spacing=0.1), (0.4, 0.2, 0.1)

    def end(stepper, pairs="own"):
        position = "serna" if "Eq. 6" in pairs else "impulse"
        with pairwise_impulses(position, on=pairs != "own", recalls="new force" not in pairs):
            sim = rts.Simulation(scene, stepper)
        sim.advance_to(0.3)
        return sim.velocities(), sim.statistics["particle_updates"] / sim.count

    reference, _ = end(rts.Uniform(courant=0.4 / 32))
    print("\ndrop\n")
    show("density", "pairs", *(f"longest step {c:g}" for c in courants), "order", "updates at 0.4")
    show(*["---"] * 7)
    for density in ("stale", "extrapolated"):
        for pairs in ("own", "impulses", "impulses, x by Eq. 6", "impulses, taken back by the new force"):
            errors, work = [], []
            for c in courants:
                options = {"alpha": c / 2, "lambda_f": c / 32, "inactive_density": density}
                v, updates = end(rts.Regional(courant=c / 3, levels=3, **options), pairs)
                errors.append(np.linalg.norm(v - reference) / np.linalg.norm(reference))
                work.append(updates)
            order = np.log(errors[0] / errors[-1]) / np.log(courants[0] / courants[-1])
            show(density, pairs, *(f"{error:.1e}" for error in errors), f"{order:.2f}", f"{work[0]:.0f}")


PARTS = {"pool": pool, "drop": drop}

if __name__ == "__main__":
    rts.init("cpu", precision="f64")
    words = sys.argv[1:]
    chosen = [word for word in words if word in STEPPERS] or list(STEPPERS)
    for part in [word for word in words if word not in STEPPERS] or [*SCENES, *PARTS]:
        PARTS[part](chosen) if part in PARTS else table(part, chosen)
