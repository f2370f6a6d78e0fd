"""The predictor-corrector of Serna, Dominguez-Tenreiro & Saiz 2003, as used by Goswami & Batty 2014, Eq. 4-7."""

from taichi_rts.device.backend import ti


@ti.data_oriented
class Serna:
    """Second order for steps that differ from particle to particle; `corrector=False` leaves the prediction as it is."""

    name = "serna"

    def __init__(self, corrector: bool = True) -> None:
        self.corrector = corrector

    @ti.func
    def predict_position(self, x, v, a, dt):
        """Eq. 4: x~ = x + v dt + a dt^2/2 [m], `dt` [s] after x, v, a were evaluated."""
        return x + (v + (0.5 * dt) * a) * dt

    @ti.func
    def predict_velocity(self, v, a, dt):
        """Eq. 5: v~ = v + a dt [m/s], the velocity that the forces see."""
        return v + a * dt

    @ti.func
    def correct_position(self, x, a, a_new, dt):
        """Eq. 6: x~ + (a' - a) dt^2/6 [m], where `dt` [s] is the time that really elapsed since the last evaluation."""
        corrected = x
        if ti.static(self.corrector):
            corrected = x + (a_new - a) * (dt * dt * (1.0 / 6.0))
        return corrected

    @ti.func
    def correct_velocity(self, v, a, a_new, dt):
        """Eq. 7: v~ + (a' - a) dt/2 [m/s], from the velocity `v` at the last evaluation."""
        corrected = v + a * dt
        if ti.static(self.corrector):
            corrected += (a_new - a) * (0.5 * dt)
        return corrected
