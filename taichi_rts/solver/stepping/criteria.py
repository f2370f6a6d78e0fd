"""Limits on a time step, one function each. All but the first only ever shorten a step.

Host functions size the base step and global steps; the ti.funcs answer for one block inside a kernel.
"""

import math

from taichi_rts.device.backend import ti
from taichi_rts.scene.scene import Scene

MACH = 0.1
"""Speeds, and excesses of the local sound speed, up to this share of c_s do not shorten a step: c_s is chosen for flow of up to
Mach 0.1 (Becker & Teschner 2007), and every default courant was found with both in it. An excess of 0.1 c_s is a compression
of 3.2 %. Calm water reaches 1 % under its own weight, and 2 % where waves run up."""


def acoustic_step(courant: float, support: float, sound_speed: float) -> float:
    """Goswami & Batty 2014, Eq. 1 [s]: lambda_v r / c_s, for `support` r [m] and `sound_speed` c_s [m/s]."""
    return courant * support / sound_speed


def force_step(lambda_f: float, support: float, acceleration: float) -> float:
    """Eq. 2 [s]: lambda_f sqrt(r / a), where `acceleration` a = F/m [m/s^2]; infinite without one."""
    return lambda_f * math.sqrt(support / acceleration) if acceleration > 0.0 else math.inf


def viscous_step(support: float, kinematic_viscosity: float) -> float:
    """Morris, Fox & Zhu 1997, Eq. 30 [s]: 0.125 h^2 / nu with h = r/2; infinite without viscosity."""
    return 0.125 * (0.5 * support) ** 2 / kinematic_viscosity if kinematic_viscosity > 0.0 else math.inf


def scene_viscous_step(scene: Scene, most: bool = True) -> float:
    """`viscous_step` [s] of the scene's most viscous fluid, or of its least."""
    return viscous_step(scene.support, max(scene.viscosities) if most else min(scene.viscosities))


def velocity_fraction(level: int, alpha: float, beta: float, beta_decay: float) -> float:
    """Right side of Eq. 3 for level n >= 2: alpha beta_n with beta_n = beta * beta_decay^(n-2)."""
    return alpha * beta * beta_decay ** (level - 2)


@ti.func
def stiffening(density_ratio):
    """Local sound speed over c_s of water compressed to `density_ratio` = rho/rho_0, less the excess that `MACH` leaves free.

    c/c_s = (rho/rho_0)^3, from Tait's equation p = rho_0 c_s^2/7 ((rho/rho_0)^7 - 1): c^2 = dp/drho = c_s^2 (rho/rho_0)^6
    (Monaghan 1994). So this is max(1, (rho/rho_0)^3 - 0.1), exactly 1 up to a compression of 3.2 %.
    """
    return ti.max(1.0, density_ratio * density_ratio * density_ratio - MACH)


@ti.func
def signal_speed(sound_speed, stiffening, speed):
    """Speed [m/s] that takes the place of c_s in Eq. 1: c + |v|, signals carried along by the fluid (Monaghan 1992)."""
    return sound_speed * stiffening + speed


@ti.func
def allows_sound(step, reach, sound_speed: ti.template(), density_ratio):
    """Eq. 1 for a step [s] where water is compressed to `density_ratio`: step c <= lambda_v r = `reach` [m]."""
    return step * sound_speed * stiffening(density_ratio) <= reach * (1.0 + 1e-6)


@ti.func
def allows_viscosity(step, support: ti.template(), viscosity):
    """`viscous_step` for a step [s] and the largest kinematic viscosity [m^2/s]: step nu <= 0.125 h^2."""
    return step * viscosity <= 0.125 * 0.25 * support * support * (1.0 + 1e-6)


@ti.func
def allows_force(step, lambda_f: ti.template(), support: ti.template(), acceleration2):
    """Eq. 2 for a step [s] and the square of the largest acceleration [m^2/s^4]: step^2 a <= lambda_f^2 r."""
    return step * step * ti.sqrt(acceleration2) <= lambda_f * lambda_f * support


@ti.func
def allows_velocity(step, fraction: ti.template(), support: ti.template(), speed2):
    """Eq. 3 for a step [s] and the square of the largest speed [m^2/s^2]: step v / r <= alpha beta_n."""
    return step * ti.sqrt(speed2) <= fraction * support
