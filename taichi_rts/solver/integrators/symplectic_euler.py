"""Symplectic Euler, kick then drift, for one step for all."""

from taichi_rts.device.backend import ti


@ti.data_oriented
class SymplecticEuler:
    """u' = u + a dt, x' = x + u' dt (Cromer 1981), with u half a step behind x.

    The state holds the velocity at whole steps, v = u + a dt/2, so the first kick is half a step and constant
    acceleration (free fall) is integrated exactly. Forces see u', as in the usual implementations.
    """

    name = "symplectic_euler"

    @ti.func
    def predict_position(self, x, v, a, dt):
        """Drift [m]: x + u' dt with u' = v + a dt/2."""
        return x + (v + (0.5 * dt) * a) * dt

    @ti.func
    def predict_velocity(self, v, a, dt):
        """Velocity [m/s] that forces see: u' = v + a dt/2."""
        return v + a * (0.5 * dt)

    @ti.func
    def correct_position(self, x, a, a_new, dt):
        """Return the drifted position [m] as it is."""
        return x

    @ti.func
    def correct_velocity(self, v, a, a_new, dt):
        """Velocity [m/s] at the whole step: u' + a' dt/2."""
        return v + (a + a_new) * (0.5 * dt)
