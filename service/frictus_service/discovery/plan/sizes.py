"""Sizes of effects that a study should show, unless others are asked for."""

from collections.abc import Mapping
from typing import Final

from frictus_hardware.physics.effects import EFFECTS
from frictus_service.discovery.errors import DesignError

WANTED: Final[Mapping[str, float]] = {
    "amplitude_compression": 0.0048,
    "channel_delay": 4e-6,
    "charge_leakage": 1.0,
    "cutoff_drift": 0.02,
    "direction_asymmetry": 0.06,
    "force_dependent_cutoff": 0.18,
    "force_dependent_gain": 0.18,
    "fractional_damping": 0.1,
    "fractional_rolloff": 0.12,
    "gain_drift": 0.02,
    "mains_interference": 0.004,
    "mount_resonance_shift": 0.0048,
    "position_dependent_gain": 0.005,
    "residual_quadratic": 0.0048,
    "second_mode": 0.1,
    "speed_dependent_cutoff": 4.8,
    "speed_dependent_gain": 0.25,
    "speed_dependent_mass": 0.3,
    "speed_dependent_stiffness": 0.4,
    "stick_slip": 0.06,
}
"""Of the first parameter. A tenth to a fifth of the response at the ends of the usual ranges
(speeds 20 to 100 mm/s, forces 0.2 to 0.6 N, 20 minutes), or what shifts a phase by some
degrees; mass and stiffness as the paper found them to rise with the speed (Section 3.2)."""


def wanted_sizes(asked: Mapping[str, float]) -> dict[str, float]:
    """Return the sizes to be shown: the usual ones, but for those that are asked for.

    Parameters
    ----------
    asked : mapping of str to float
        By id of the effect.

    Raises
    ------
    DesignError
        If there is no such effect, or a size is not above zero and within its bounds.
    """
    for id_, size in asked.items():
        if id_ not in EFFECTS:
            raise DesignError(f"no effect {id_!r} is known; known are: {', '.join(EFFECTS)}")
        dose = EFFECTS[id_].parameters[0]
        if not 0.0 < size <= dose.high:
            raise DesignError(
                f"{id_}: a {dose.name} of {size:g} is wanted; accepted: above 0, up to "
                f"{dose.high:g} {dose.unit}"
            )
    return {**WANTED, **asked}
