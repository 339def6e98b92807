"""The checks: one statistic of a person's trials each, what is accepted, and what to say."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.plausibility.finding import Severity
from frictus_service.identification.plausibility.impedance import Impedance, fit_impedance
from frictus_service.identification.plausibility.trial_statistics import TrialStatistics


@dataclass(frozen=True, slots=True)
class TrialRecord:
    """What the checks know of one trial.

    Attributes
    ----------
    observed : TrialObservations
        Of trials without tones, rows from cross-spectra may stand in it.
    statistics : TrialStatistics
    """

    observed: TrialObservations
    statistics: TrialStatistics


@dataclass(frozen=True, slots=True)
class Pool:
    """All trials of one participant, and what is computed once of them.

    Attributes
    ----------
    trials : tuple of TrialRecord
    impedance : Impedance
        Behind the mobility of all of them.
    """

    trials: tuple[TrialRecord, ...]
    impedance: Impedance

    @classmethod
    def of(cls, trials: Sequence[TrialRecord]) -> "Pool":
        """Return the pool of some trials."""
        rows = [each.observed.rows for each in trials]
        found = fit_impedance(
            np.concatenate([each.tone_hz for each in rows]),
            np.concatenate([each.mobility for each in rows]),
            np.concatenate([each.mobility_variance for each in rows]),
        )
        return cls(tuple(trials), found)

    def column(self, name: str) -> FloatArray:
        """Return a statistic of all trials, shape (n_trials,)."""
        return np.array([getattr(each.statistics, name) for each in self.trials])


@dataclass(frozen=True, slots=True)
class Check:
    """One check.

    Attributes
    ----------
    code : str
    severity : {'stop', 'warning'}
    statistic : callable
        Of the trials of one participant; NaN where they cannot tell.
    accepted : tuple of float
        What a healthy measurement gives.
    sentence : str
        With ``{value}``.
    remedy : callable or str
        From the value.
    """

    code: str
    severity: Severity
    statistic: Callable[[Pool], float]
    accepted: tuple[float, float]
    sentence: str
    remedy: Callable[[float], str] | str

    def passes(self, value: float) -> bool:
        """Return whether a value is accepted; one that is not known is."""
        return bool(np.isnan(value) or self.accepted[0] <= value <= self.accepted[1])

    def advice(self, value: float) -> str:
        """Return what to do."""
        return self.remedy if isinstance(self.remedy, str) else self.remedy(value)


LOW_HZ: Final = 250.0
"""Up to here friction follows the drive within a quarter of a period, whatever its law."""
FAR: Final = 0.25
"""From its target: another condition than the one asked for."""
UNIT_FACTORS: Final = {
    "a thousand": 1000.0,
    "g (9.81 m/s2), or N for kgf": 9.80665,
    "a hundred, or gram-force (0.00981 N)": 101.97,
    "inch (25.4 mm)": 25.4,
    "ten": 10.0,
}
NEAR: Final = 1.25
"""A value so near to a factor is taken for it."""


def middle(values: FloatArray) -> float:
    """Return the median of what is known; NaN where nothing is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else np.nan


def _speed_ratios(pool: Pool) -> FloatArray:
    targets = [each.observed.info.speed_mm_s or np.nan for each in pool.trials]
    return np.array([each.observed.mean_speed_mm_s for each in pool.trials]) / targets


def _force_ratios(pool: Pool) -> FloatArray:
    targets = [each.observed.info.force_n or np.nan for each in pool.trials]
    return pool.column("normal_n") / np.array(targets)


def _share_off(ratios: FloatArray) -> float:
    known = ratios[np.isfinite(ratios)]
    return float(np.mean(np.abs(known - 1.0) > FAR)) if known.size else np.nan


def _friction(pool: Pool, part: str) -> float:
    """Return the friction coefficient along or across, both directions weighing the same.

    A force that a sensor reports at rest is of one sign in both and drops out.
    """
    coefficients = []
    for side in ("right", "left"):
        seconds = pool.column(f"{side}_s")
        there = seconds > 0.0
        if not there.any():
            continue
        force = pool.column(f"{side}_{part}_n")[there] @ seconds[there]
        normal = np.abs(pool.column(f"{side}_normal_n")[there]) @ seconds[there]
        coefficients.append(force / normal if normal > 0.0 else np.nan)
    return float(np.mean(coefficients)) if coefficients else np.nan


def _across_friction(pool: Pool) -> float:
    along, across = (abs(_friction(pool, part)) for part in ("force", "across"))
    return across / max(along, 0.01) if across > 0.05 else 0.0


def _drive_sign(pool: Pool) -> float:
    """Return the weighted mean cosine of the phase of friction at low tones."""
    rows = [each.observed.rows for each in pool.trials]
    tones_hz = np.concatenate([each.tone_hz for each in rows])
    response: ComplexArray = np.concatenate([each.friction_response for each in rows])
    variance = np.concatenate([each.friction_variance for each in rows])
    low = (tones_hz <= LOW_HZ) & np.isfinite(response) & (response != 0.0)
    low &= np.isfinite(variance)
    if not low.any():
        return np.nan
    size = np.abs(response[low])
    weight = 1.0 / (0.1**2 + 2.0 * variance[low] / np.square(size))
    return float(weight @ (response[low].real / size) / weight.sum())


def _kinematic(pool: Pool) -> tuple[float, float]:
    """Return slope and correlation of the skin's sensor on the motion of the finger."""
    of_motion, shared, of_skin = (
        np.nansum(pool.column(name)) for name in ("motion_power", "shared", "skin_power")
    )
    if not (of_motion > 0.0 and of_skin > 0.0):
        return np.nan, np.nan
    return float(shared / of_motion), float(shared / np.sqrt(of_motion * of_skin))


def _scale(pool: Pool) -> float:
    slope, correlation = _kinematic(pool)
    return abs(slope) if abs(correlation) > FOLLOWS else np.nan


def _skin_direction(pool: Pool) -> float:
    slope, correlation = _kinematic(pool)
    return float(np.sign(slope)) if abs(correlation) > FOLLOWS else np.nan


FOLLOWS: Final = 0.7
"""Correlation above which the skin's sensor is taken to follow the finger's motion."""


def _normal_axis(pool: Pool) -> float:
    lateral, normal = middle(pool.column("lateral_n")), middle(pool.column("normal_n"))
    return lateral / max(abs(normal), 1e-3) if lateral > 0.05 else 0.0


def _nearest_unit(value: float) -> str:
    factor = max(value, 1.0 / value)
    for name, known in UNIT_FACTORS.items():
        if max(factor / known, known / factor) < NEAR:
            return f" (a factor of {value:.3g} looks like {name})"
    return ""


def _wrong_unit(what: str) -> Callable[[float], str]:
    return lambda value: f"correct the unit of {what}{_nearest_unit(abs(value))}"


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
        _normal_axis,
        (0.0, 5.0),
        "a lateral column of force_n is {value:.2g} times the normal one throughout",
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
        lambda pool: abs(middle(_force_ratios(pool))),
        (1.0 / 3.0, 3.0),
        "the normal force is {value:.3g} times its target",
        lambda value: (
            _wrong_unit("force_n (N), or of the target force_n")(value)
            + ", or multiply volts by the sensor's sensitivity"
        ),
    ),
    Check(
        "speed_unit",
        "stop",
        lambda pool: middle(_speed_ratios(pool)),
        (1.0 / 3.0, 3.0),
        "the speed from the positions is {value:.3g} times its target",
        _wrong_unit("position_mm (mm), of position_t_s (s), or of speed_mm_s"),
    ),
    Check(
        "friction_sign",
        "stop",
        lambda pool: _friction(pool, "force"),
        (-0.03, np.inf),
        "the lateral force is against the motion (coefficient of friction {value:.2g})",
        "turn the sign of force_n along x, or of position_mm along x: the sensor under the "
        "screen reports a force of the sign of the velocity; or take the sensor's zero off",
    ),
    Check(
        "friction_unit",
        "stop",
        lambda pool: abs(_friction(pool, "force")),
        (0.0, 10.0),
        "the lateral force is {value:.3g} times the normal one",
        _wrong_unit("the lateral columns of force_n (N)"),
    ),
    Check(
        "friction_axis",
        "stop",
        _across_friction,
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
        _drive_sign,
        (-0.2, 1.0),
        "friction falls when the drive rises (mean cosine of its phase {value:.2f})",
        "turn the sign of force_n along x, or of position_mm along x",
    ),
    Check(
        "mobility_sign",
        "stop",
        lambda pool: pool.impedance.passivity,
        (-0.2, 1.0),
        "the mobility of the skin gives energy out (passivity {value:.2f}): velocity or force "
        "has the wrong sign",
        "turn the sign of accel_m_s2 or skin_velocity_m_s along x, or that of force_n along x",
    ),
    Check(
        "skin_direction",
        "stop",
        _skin_direction,
        (0.0, 1.0),
        "the skin's sensor moves against the finger's positions",
        "turn the sign of accel_m_s2 or skin_velocity_m_s along x, or of position_mm along x",
    ),
    Check(
        "skin_scale",
        "stop",
        _scale,
        (0.33, 3.0),
        "the skin's sensor shows {value:.3g} times the motion of the finger's positions",
        _wrong_unit("accel_m_s2 (m/s2), of skin_velocity_m_s (m/s), or of position_mm"),
    ),
    Check(
        "skin_unit",
        "stop",
        lambda pool: pool.impedance.damping_n_s_m,
        (0.15, 6.0),
        "the skin's damping comes out as {value:.3g} N s/m",
        lambda value: _wrong_unit(
            "accel_m_s2 (m/s2), of skin_velocity_m_s (m/s), or of force_n (N)"
        )(value / 1.3),
    ),
    Check(
        "carrier",
        "stop",
        lambda pool: middle(pool.column("carrier_ratio")),
        (0.95, 1.05),
        "the strongest line of voltage_v lies at {value:.3g} times the carrier",
        "correct sample_rate_hz, or carrier_hz",
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
        lambda pool: _share_off(_speed_ratios(pool)),
        (0.0, 0.3),
        "the measured speed is more than 25 % off speed_mm_s in {value:.0%} of the trials",
        "write the speed that was asked for; the speed that was measured is used",
    ),
    Check(
        "force_target",
        "warning",
        lambda pool: _share_off(_force_ratios(pool)),
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
    ),
    Check(
        "clipped",
        "warning",
        lambda pool: float(np.mean(pool.column("clipped") > 0.0)),
        (0.0, 0.05),
        "a channel is clipped in {value:.0%} of the trials",
        "widen the range of the converter or lower the gain of the amplifier",
    ),
)
