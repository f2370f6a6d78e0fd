"""Limits on a time step, one function each. All but the first only ever shorten a step.

Host functions size the base step and global steps; the ti.funcs answer for one block inside a kernel.
"""

import math

import taichi as ti

from taichi_rts.scene import Scene


def acoustic_step(courant: float, support: float, sound_speed: float) -> float:
    """Goswami & Batty 2014, Eq. 1 [s]: lambda_v r / c_s, for `support` r [m] and `sound_speed` c_s [m/s]."""
    return courant * support / sound_speed


def advective_step(courant: float, support: float, sound_speed: float, speed: float) -> float:
    """Eq. 1 with signals carried along by the fluid [s]: lambda_v r / (c_s + |v|) (Monaghan 1992)."""
    return courant * support / (sound_speed + speed)


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
