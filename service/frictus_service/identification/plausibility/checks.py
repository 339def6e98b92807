"""The checks: one statistic of a person's trials each, what is accepted, and what to say."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_service.identification.plausibility.finding import Severity
from frictus_service.identification.plausibility.pool import (
    Pool,
    ResponseName,
    across_friction,
    coherence,
    drive_sign,
    force_ratios,
    friction_coefficient,
    middle,
    normal_axis,
    passivity,
    positions_late_s,
    share_off,
    skin_direction,
    skin_scale,
    speed_ratios,
)


@dataclass(frozen=True, slots=True)
class Check:
    """One check.

    Attributes
    ----------
    code : str
        Of the check, such as ``mobility_sign``.
    severity : {'stop', 'warning'}
    statistic : callable
        Of the trials of one participant; NaN where they cannot tell.
    accepted : tuple of float
        What a healthy measurement gives.
    sentence : str
        With ``{value}``.
    remedy : callable or str
        From the value.
    below_0 : str or None
        The sentence of a value below 0, with ``{value}`` without its sign; None: the same.
    """

    code: str
    severity: Severity
    statistic: Callable[[Pool], float]
    accepted: tuple[float, float]
    sentence: str
    remedy: Callable[[float], str] | str
    below_0: str | None = None

    def passes(self, value: float) -> bool:
        """Return whether a value is accepted; one that is not known is."""
        return bool(np.isnan(value) or self.accepted[0] <= value <= self.accepted[1])

    def told(self, value: float) -> str:
        """Return the sentence about a value."""
        if value < 0.0 and self.below_0 is not None:
            return self.below_0.format(value=-value)
        return self.sentence.format(value=value)

    def advice(self, value: float) -> str:
        """Return what to do."""
        return self.remedy if isinstance(self.remedy, str) else self.remedy(value)


USUAL_DAMPING_N_S_M: Final = 1.3

FORCE_UNITS: Final = {1000.0: "mN", 101.97: "gram-force", 0.101972: "kgf", 0.001: "kN"}
MOTION_UNITS: Final = {1000.0: "um", 0.1: "cm", 1.0 / 25.4: "inches", 0.001: "m"}
SKIN_UNITS: Final = {1000.0: "mm/s2 or mm/s", 100.0: "cm/s2 or cm/s", 1.0 / 9.80665: "g"}
"""What a value in N, mm, m/s2 or m/s looks like, if it is so many times too large."""


def unit_guess(factor: float, units: dict[float, str], near: float = 1.25) -> str:
    """Return the unit that a factor looks like, in words; empty where there is none.

    Parameters
    ----------
    factor : float
        Value over what is usual.
    units : dict
        From the factor to its name.
    near : float
        By which the two may differ.
    """
    for known, name in units.items():
        if 1.0 / near < abs(factor) / known < near:
            return f", which looks like {name}"
    return ""


MOST_LATE_MS: Final = (-10.0, 10.0)
BANDS_HZ: Final = ((20.0, 60.0), (60.0, 200.0), (200.0, 600.0), (600.0, 2500.0))
RESPONSES: Final[tuple[ResponseName, ...]] = ("friction", "mobility")


def _coherence_check(response: ResponseName, band_hz: tuple[float, float]) -> Check:
    what = "friction and drive" if response == "friction" else "skin and friction"
    low_hz, high_hz = band_hz
    return Check(
        f"{response}_coherence_{low_hz:g}",
        "warning",
        lambda pool: coherence(pool, response, band_hz),
        (0.5, 1.0),
        f"from {low_hz:g} to {high_hz:g} Hz, {what} are mostly noise (coherence {{value:.2f}})",
        "drive more strongly, mount the sensor anew, or leave these tones out",
    )


CHECKS: Final = (
    Check(
        "motion_axis",
        "stop",
        lambda pool: middle(pool.column("across_motion")),
        (0.0, 2.0),
        "the finger moves {value:.2g} times as fast along y as along x",
        "swap the columns of position_mm, and of force and acceleration with them: x is along "
        "the slide",
    ),
    Check(
        "normal_axis",
        "stop",
        normal_axis,
        (0.0, 5.0),
        "a lateral column of force_n is {value:.2g} times the normal one throughout",
        "put the columns of force_n in the order x, y, z: z is into the screen",
    ),
    Check(
        "normal_flips",
        "stop",
        lambda pool: middle(pool.column("normal_flips")),
        (0.0, 0.2),
        "the normal force changes its sign, {value:.0%} of the time the rarer one",
        "put the columns of force_n in the order x, y, z: z is into the screen",
    ),
    Check(
        "normal_sign",
        "stop",
        lambda pool: float(np.sign(middle(pool.column("normal_n")))),
        (0.0, 1.0),
        "the normal force is negative: it has the wrong sign",
        "turn the sign of column 2 of force_n: z is positive into the screen",
    ),
    Check(
        "force_unit",
        "stop",
        lambda pool: abs(middle(force_ratios(pool))),
        (1.0 / 3.0, 3.0),
        "the normal force is {value:.3g} times its target",
        lambda value: (
            "correct the unit of force_n (N) or of its target"
            f"{unit_guess(value, FORCE_UNITS)}; volts are to be divided by the sensitivity"
        ),
    ),
    Check(
        "speed_unit",
        "stop",
        lambda pool: middle(speed_ratios(pool)),
        (1.0 / 3.0, 3.0),
        "the speed from the positions is {value:.3g} times its target",
        lambda value: (
            "correct the unit of position_mm (mm), of position_t_s (s), or of the "
            f"target speed_mm_s{unit_guess(value, MOTION_UNITS)}"
        ),
    ),
    Check(
        "friction_sign",
        "stop",
        lambda pool: friction_coefficient(pool, "force"),
        (-0.03, np.inf),
        "the lateral force is against the motion (coefficient of friction {value:.2g})",
        "turn the sign of force_n along x, or of position_mm along x: the sensor under the "
        "screen reports a force of the sign of the velocity; or take the sensor's zero off",
    ),
    Check(
        "friction_unit",
        "stop",
        lambda pool: abs(friction_coefficient(pool, "force")),
        (0.0, 10.0),
        "the lateral force is {value:.3g} times the normal one",
        lambda value: (
            "correct the unit of the lateral columns of force_n (N)"
            f"{unit_guess(value / 0.3, FORCE_UNITS, 2.0)}"
        ),
    ),
    Check(
        "friction_axis",
        "stop",
        across_friction,
        (0.0, 3.0),
        "friction across the motion is {value:.2g} times that along it",
        "swap the first two columns of force_n: x is along the slide",
    ),
    Check(
        "force_axis",
        "stop",
        lambda pool: middle(pool.column("force_across")),
        (0.0, 10.0),
        "the force from 20 to 1000 Hz has {value:.2g} times as much power along y as along x",
        "swap the first two columns of force_n: x is along the slide",
    ),
    Check(
        "skin_axis",
        "stop",
        lambda pool: middle(pool.column("skin_across")),
        (0.0, 10.0),
        "the acceleration from 20 to 1000 Hz has {value:.2g} times as much power along y as "
        "along x",
        "swap the first two columns of accel_m_s2: x is along the slide",
    ),
    Check(
        "drive_sign",
        "stop",
        drive_sign,
        (-0.2, 1.0),
        "friction falls when the drive rises (mean cosine of its phase {value:.2f})",
        "turn the sign of force_n along x, or of position_mm along x",
    ),
    Check(
        "mobility_sign",
        "stop",
        passivity,
        (-0.2, 1.0),
        "the mobility of the skin gives energy out (passivity {value:.2f}): velocity or force "
        "has the wrong sign",
        "turn the sign of accel_m_s2 or skin_velocity_m_s along x, or that of force_n along x",
    ),
    Check(
        "skin_direction",
        "stop",
        skin_direction,
        (0.0, 1.0),
        "the skin's sensor moves against the finger's positions",
        "turn the sign of accel_m_s2 or skin_velocity_m_s along x, or of position_mm along x",
    ),
    Check(
        "skin_scale",
        "stop",
        skin_scale,
        (0.33, 3.0),
        "the skin's sensor shows {value:.3g} times the motion of the finger's positions",
        lambda value: (
            "correct the unit of accel_m_s2 (m/s2) or skin_velocity_m_s (m/s)"
            f"{unit_guess(value, SKIN_UNITS)}; or of position_mm (mm)"
        ),
    ),
    Check(
        "skin_unit",
        "stop",
        lambda pool: pool.impedance.damping_n_s_m,
        (0.15, 6.0),
        "the skin's damping comes out as {value:.3g} N s/m",
        lambda value: (
            "correct the unit of accel_m_s2 (m/s2) or skin_velocity_m_s (m/s)"
            f"{unit_guess(USUAL_DAMPING_N_S_M / value, SKIN_UNITS, 2.0)}; or of force_n (N)"
        ),
    ),
    Check(
        "carrier",
        "stop",
        lambda pool: middle(pool.column("carrier_ratio")),
        (0.95, 1.05),
        "the strongest line of voltage_v lies at {value:.3g} times the carrier",
        "correct sample_rate_hz, or carrier_hz; a drive without its carrier is kept as its "
        "rms, which is never negative (drive_envelope in a column map)",
    ),
    Check(
        "stamps",
        "stop",
        lambda pool: middle(pool.column("coverage")),
        (0.0, 1.1),
        "the times of the positions span {value:.3g} times the samples",
        "correct sample_rate_hz (samples per second of all sampled data), or the clock of "
        "position_t_s",
    ),
    Check(
        "drive_peak",
        "warning",
        lambda pool: middle(pool.column("drive_ratio")),
        (0.8, 1.25),
        "voltage_v peaks at {value:.2g} times half of drive_vpp",
        "see whether the monitor is clipped or its gain is another (the gain of the model goes "
        "with the square of the voltage), or write as drive_vpp what was played",
    ),
    Check(
        "stamps_missing",
        "warning",
        lambda pool: middle(pool.column("coverage")),
        (0.5, np.inf),
        "the times of the positions span {value:.0%} of the samples",
        "check sample_rate_hz and position_t_s; what no position covers is not used",
    ),
    Check(
        "speed_target",
        "warning",
        lambda pool: share_off(speed_ratios(pool)),
        (0.0, 0.3),
        "the measured speed is more than 25 % off speed_mm_s in {value:.0%} of the trials",
        "write the speed that was asked for; the speed that was measured is used",
    ),
    Check(
        "force_target",
        "warning",
        lambda pool: share_off(force_ratios(pool)),
        (0.0, 0.3),
        "the measured normal force is more than 25 % off force_n in {value:.0%} of the trials",
        "write the force that was asked for, and take the sensor's zero off",
    ),
    Check(
        "skin_delay",
        "warning",
        lambda pool: 1e6 * pool.impedance.delay_s,
        (-100.0, 100.0),
        "the skin's sensor is {value:.0f} us late beside the force",
        "write it as the attribute skew_s of the skin's data set if it is the instrument's",
        "the skin's sensor is {value:.0f} us early beside the force",
    ),
    Check(
        "position_delay_removed",
        "warning",
        lambda pool: 1e3 * middle(pool.column("positions_earlier_s")),
        MOST_LATE_MS,
        "the positions come {value:.0f} ms late, at all speeds alike, and are used as much "
        "earlier",
        "write what the touch sensor's delay is, in s, as the root attribute positions_late_s "
        "of the study, or 0 if it has none",
        "the positions come {value:.0f} ms early, at all speeds alike, and are used as much "
        "later",
    ),
    Check(
        "position_delay",
        "warning",
        lambda pool: 1e3 * positions_late_s(pool),
        MOST_LATE_MS,
        "the positions turn {value:.0f} ms later than friction or the skin's sensor",
        "write it, in s, as the root attribute positions_late_s of the study, or in the column "
        "map, if it is the touch sensor's: else causes of place, direction and speed may be "
        "named that are not there",
        "the positions turn {value:.0f} ms earlier than friction or the skin's sensor",
    ),
    Check(
        "clipped",
        "warning",
        lambda pool: float(np.mean(pool.column("clipped") > 0.0)),
        (0.0, 0.05),
        "a channel is clipped in {value:.0%} of the trials",
        "widen the range of the converter or lower the gain of the amplifier",
    ),
    *(_coherence_check(response, band_hz) for response in RESPONSES for band_hz in BANDS_HZ),
)
