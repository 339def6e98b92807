"""The finger's skin as mass, spring and damper. Paper, Section 3.2."""

from dataclasses import dataclass

from frictus_hardware.physics.linear import TransferFunction


@dataclass(frozen=True, slots=True)
class Mobility:
    """``v(s) / F(s) = s / (m s^2 + b s + k)``: friction force to skin velocity.

    The defaults are the paper's example at 40 mm/s and 0.2 N.

    Attributes
    ----------
    mass_kg : float
        m, the moving mass of the finger pad.
    damping_n_s_m : float
        b.
    stiffness_n_m : float
        k.
    """

    mass_kg: float = 0.0015
    damping_n_s_m: float = 1.3
    stiffness_n_m: float = 444.0

    @property
    def velocity(self) -> TransferFunction:
        """Skin velocity per newton of friction, m/s/N."""
        return TransferFunction((1.0, 0.0), self._denominator)

    @property
    def acceleration(self) -> TransferFunction:
        """Skin acceleration per newton of friction, m/s²/N."""
        return TransferFunction((1.0, 0.0, 0.0), self._denominator)

    @property
    def _denominator(self) -> tuple[float, float, float]:
        return (self.mass_kg, self.damping_n_s_m, self.stiffness_n_m)
