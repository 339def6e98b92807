"""The statistics that the checks judge, each of all trials of one participant."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.identification.observation.response import TrialObservations
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
        Of its samples.
    """

    observed: TrialObservations
    statistics: TrialStatistics


@dataclass(frozen=True, slots=True)
class Pool:
    """All trials of one participant, and what is computed once of them.

    Attributes
    ----------
    trials : tuple of TrialRecord
        In any order.
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


ResponseName = Literal["friction", "mobility"]

LEAST_ROWS: Final = 3
"""Of a band, for its coherence."""
LOW_HZ: Final = 250.0
"""Up to here friction follows the drive, and skin friction, within a quarter of a period."""
FAR: Final = 0.25
"""From its target: another condition than the one asked for."""
FOLLOWS: Final = 0.9
"""Correlation above which the skin's sensor is taken to follow the finger's motion."""


def middle(values: FloatArray) -> float:
    """Return the median of what is known; NaN where nothing is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else np.nan


def speed_ratios(pool: Pool) -> FloatArray:
    """Return measured over target speed of each trial; NaN without a target."""
    targets = [each.observed.info.speed_mm_s or np.nan for each in pool.trials]
    measured = np.array([each.observed.mean_speed_mm_s for each in pool.trials])
    ratios: FloatArray = measured / np.array(targets)
    return ratios


def force_ratios(pool: Pool) -> FloatArray:
    """Return measured over target normal force of each trial; NaN without a target."""
    targets = [each.observed.info.force_n or np.nan for each in pool.trials]
    normal_n = pool.column("normal_n")
    ratios: FloatArray = np.where(normal_n == 0.0, np.nan, normal_n) / np.array(targets)
    return ratios  # a dead sensor is no unit


def share_off(ratios: FloatArray) -> float:
    """Return the share of the trials that are far from their target."""
    known = ratios[np.isfinite(ratios)]
    return float(np.mean(np.abs(known - 1.0) > FAR)) if known.size else np.nan


def friction_coefficient(pool: Pool, part: str) -> float:
    """Return the friction coefficient along or across, both directions weighing the same.

    A force that a sensor reports at rest is of one sign in both and drops out.
    """
    coefficients = []
    for side in ("right", "left"):
        seconds = pool.column(f"{side}_s")
        there = seconds > 0.0
        if not there.any():
            continue
        force = float(pool.column(f"{side}_{part}_n")[there] @ seconds[there])
        normal = float(np.abs(pool.column(f"{side}_normal_n")[there]) @ seconds[there])
        coefficients.append(force / normal if normal > 0.0 else np.nan)
    return float(np.mean(coefficients)) if coefficients else np.nan


def across_friction(pool: Pool) -> float:
    """Return friction across the motion over that along it; 0 where it is small."""
    along, across = (abs(friction_coefficient(pool, part)) for part in ("force", "across"))
    return across / max(along, 0.01) if across > 0.05 else 0.0


def drive_sign(pool: Pool) -> float:
    """Return the mean cosine of the phase of friction at low tones."""
    return _mean_cosine(pool, "friction")


def coherence(pool: Pool, response: ResponseName, band_hz: tuple[float, float]) -> float:
    """Return the median share of the responses in a band that is not noise.

    Power of a response less that of its error, over its power: what is coherent in the segment
    that it comes from.
    """
    tones_hz, measured, variance = _known(pool, response)
    within = (tones_hz >= band_hz[0]) & (tones_hz < band_hz[1])
    if np.count_nonzero(within) < LEAST_ROWS:
        return np.nan
    power = np.square(np.abs(measured[within]))
    return float(np.median(np.maximum(power - 2.0 * variance[within], 0.0) / power))


def _mean_cosine(pool: Pool, response: ResponseName) -> float:
    """Return the mean cosine of a response's phase at low tones, weighed by its certainty."""
    tones_hz, measured, variance = _known(pool, response)
    low = tones_hz <= LOW_HZ
    if not low.any():
        return np.nan
    size = np.abs(measured[low])
    weight = 1.0 / (0.1**2 + 2.0 * variance[low] / np.square(size))
    return float(weight @ (measured[low].real / size) / weight.sum())


def _known(pool: Pool, response: ResponseName) -> tuple[FloatArray, ComplexArray, FloatArray]:
    """Return tones, responses and variances of all rows that say something."""
    friction = response == "friction"
    rows = [each.observed.rows for each in pool.trials]
    tones_hz = np.concatenate([each.tone_hz for each in rows])
    measured: ComplexArray = np.concatenate(
        [each.friction_response if friction else each.mobility for each in rows]
    )
    variance = np.concatenate(
        [each.friction_variance if friction else each.mobility_variance for each in rows]
    )
    known = np.isfinite(measured) & (measured != 0.0) & np.isfinite(variance)
    return tones_hz[known], measured[known], variance[known]


def passivity(pool: Pool) -> float:
    """Return how passive the skin is, from 1 to -1; of one or two tones from low ones alone."""
    if not np.isnan(pool.impedance.passivity):
        return pool.impedance.passivity
    return _mean_cosine(pool, "mobility")


def _kinematic(pool: Pool) -> tuple[float, float]:
    """Return slope and correlation of the skin's sensor on the motion of the finger."""
    of_motion, shared, of_skin = (
        np.nansum(pool.column(name)) for name in ("motion_power", "shared", "skin_power")
    )
    if not (of_motion > 0.0 and of_skin > 0.0):
        return np.nan, np.nan
    return float(shared / of_motion), float(shared / np.sqrt(of_motion * of_skin))


def skin_scale(pool: Pool) -> float:
    """Return how many times the finger's motion the skin's sensor shows."""
    slope, correlation = _kinematic(pool)
    return abs(slope) if abs(correlation) > FOLLOWS else np.nan


def skin_direction(pool: Pool) -> float:
    """Return 1 where the skin's sensor follows the finger's motion, -1 where against."""
    slope, correlation = _kinematic(pool)
    return float(np.sign(slope)) if abs(correlation) > FOLLOWS else np.nan


def normal_axis(pool: Pool) -> float:
    """Return the lateral over the normal force where the lateral one would fit the target."""
    lateral, normal = middle(pool.column("lateral_n")), middle(pool.column("normal_n"))
    target = middle(np.array([each.observed.info.force_n for each in pool.trials]))
    fits = target / 3.0 < lateral < 3.0 * target
    return lateral / max(abs(normal), 1e-3) if fits else 0.0
