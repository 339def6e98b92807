"""The statistics that the checks judge, each of all trials of one participant.

Behind a mobility, a mass, spring and damper of either sign and a delay are looked for. A
fingertip takes energy up: the real part of its mobility is positive at every frequency. The
likeliest slip of all is a sign, and a delay between the channels turns phases too; so both are
searched together. With ``Y = ± exp(-jωτ) / (b + jωm + k / jω)``, `b`, `m` and `k` follow from
non-negative least squares on the relative error for each sign and delay.

Wiertlewski and Hayward 2012, J. Biomech. 45: lateral damping of fingertips 0.75 to 2.4 N·s/m.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from scipy.optimize import nnls

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.plausibility.trial_statistics import TrialStatistics

DELAYS_S: Final = np.linspace(-1e-3, 1e-3, 81)
"""By which channels of one device may be apart."""
FINE: Final = 26
LEAST_TONES: Final = 3
FLOOR: Final = 0.1
"""Relative error of a response whatever its noise: skins are no mass, spring and damper."""

MOST_MISFIT: Final = 0.5
"""Mean square relative misfit beyond which there is no mass, spring and damper to speak of."""


@dataclass(frozen=True, slots=True)
class Impedance:
    """The best mass, spring and damper; NaN where there are too few tones.

    Attributes
    ----------
    passivity : float
        Mean square relative misfit of the negative sign less that of the positive: near 1 for a
        skin, near -1 for one of the wrong sign, 0 where either would do.
    delay_s : float
        By which the skin's channel is late, at the better sign.
    damping_n_s_m : float
        At the better sign and delay.
    """

    passivity: float
    delay_s: float
    damping_n_s_m: float


UNKNOWN: Final = Impedance(np.nan, np.nan, np.nan)


def fit_impedance(
    frequency_hz: FloatArray, mobility: ComplexArray, variance: FloatArray
) -> Impedance:
    """Return the impedance behind a mobility.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    mobility : ndarray of complex, shape (n,)
        m/s/N, NaN where unknown.
    variance : ndarray, shape (n,)
        Of real and of imaginary part each.
    """
    known = np.isfinite(mobility) & (mobility != 0.0) & np.isfinite(variance)
    tones_hz, of_tone = np.unique(frequency_hz[known], return_inverse=True)
    if tones_hz.size < LEAST_TONES:
        return UNKNOWN
    relative = 2.0 * variance[known] / np.square(np.abs(mobility[known]))
    weight = 1.0 / (FLOOR**2 + relative)
    total = np.bincount(of_tone, weight)
    real, imaginary = (
        np.bincount(of_tone, weight * part) / total
        for part in (mobility[known].real, mobility[known].imag)
    )
    mean: ComplexArray = real + 1j * imaginary
    # No tone outweighs the others by how often it was played.
    each = total / np.bincount(of_tone).astype(np.float64)
    plus, minus = (_best(tones_hz, sign * mean, each) for sign in (1.0, -1.0))
    chosen = plus if plus[0] <= minus[0] else minus
    passivity = minus[0] - plus[0]
    if chosen[0] > MOST_MISFIT or chosen[2] <= 0.0:
        return Impedance(passivity, np.nan, np.nan)
    return Impedance(passivity, chosen[1], chosen[2])


def _best(
    tones_hz: FloatArray, mobility: ComplexArray, weight: FloatArray
) -> tuple[float, float, float]:
    """Return mean square relative misfit, delay and damping at the best delay."""
    found = min(_fits(tones_hz, mobility, weight, DELAYS_S))
    step = float(DELAYS_S[1] - DELAYS_S[0])
    fine = found[1] + np.linspace(-step, step, FINE)
    return min(found, min(_fits(tones_hz, mobility, weight, fine)))


def _fits(
    tones_hz: FloatArray, mobility: ComplexArray, weight: FloatArray, delays_s: FloatArray
) -> list[tuple[float, float, float]]:
    omega = 2.0 * np.pi * tones_hz
    parts = np.column_stack([np.ones(omega.size), 1j * omega / 1e3, -1j / omega * 1e3])
    root = np.sqrt(weight / weight.sum())
    wanted = np.concatenate([root, np.zeros(root.size)])
    found = []
    for delay_s in delays_s.tolist():
        undone = root * mobility * np.exp(1j * omega * delay_s)
        columns = undone[:, np.newaxis] * parts
        values, norm = nnls(np.concatenate([columns.real, columns.imag]), wanted)
        found.append((float(norm) ** 2, float(delay_s), float(values[0])))
    return found


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
LEAST_DRIVEN: Final = 0.1
"""Of the strongest drive in a band, by amplitude: what is driven by less is not."""
LOW_HZ: Final = 250.0
"""Up to here friction follows the drive, and skin friction, within a quarter of a period."""
FAR: Final = 0.25
"""From its target: another condition than the one asked for."""
AGAINST: Final = 0.25
"""Of a person's usual friction in a direction; what a sensor drifts by is less."""
LEAST_COEFFICIENT: Final = 0.05
"""Of friction whose sign is a person's."""
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


def positions_late_s(pool: Pool) -> float:
    """Return by how much positions follow friction or the skin's sensor, whichever is more.

    A finger that rests at its turns makes them seem early beside friction: that says nothing.
    """
    by_skin, by_friction = (
        middle(pool.column(f"late_by_{source}_s")) for source in ("skin", "friction")
    )
    found = [by_skin, by_friction if by_friction > 0.0 else np.nan]
    return max(found, key=lambda late_s: -1.0 if np.isnan(late_s) else abs(late_s))


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


def turned_trials(trials: Sequence[TrialRecord]) -> tuple[str, ...]:
    """Return the ids of trials in which friction has the other sign than in most of a person's.

    Each direction is held against the median of the others in it: what the sensor reports at
    rest is in both.

    Parameters
    ----------
    trials : sequence of TrialRecord
        Of one participant.
    """
    against, known = np.ones(len(trials), np.bool_), np.zeros(len(trials), np.bool_)
    for side in ("right", "left"):
        along, normal = (
            np.array([getattr(each.statistics, f"{side}_{part}_n") for each in trials])
            for part in ("force", "normal")
        )
        usual, there = middle(along), np.isfinite(along)
        sure = usual > LEAST_COEFFICIENT * abs(middle(normal))
        against &= ~there | (sure & (along < -AGAINST * usual))
        known |= there
    against &= known
    return tuple(
        each.observed.info.id
        for each, turned in zip(trials, against.tolist(), strict=True)
        if turned
    )


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
    that it comes from. A chirp, or a texture's line, is elsewhere most of the time: what is not
    driven is noise in the best of sensors, and does not count.
    """
    tones_hz, measured, variance, drive = _known(pool, response)
    within = (tones_hz >= band_hz[0]) & (tones_hz < band_hz[1])
    driven = drive[within & np.isfinite(drive)]
    if driven.size:
        within &= ~(drive < LEAST_DRIVEN * driven.max())
    if np.count_nonzero(within) < LEAST_ROWS:
        return np.nan
    power = np.square(np.abs(measured[within]))
    return float(np.median(np.maximum(power - 2.0 * variance[within], 0.0) / power))


def _mean_cosine(pool: Pool, response: ResponseName) -> float:
    """Return the mean cosine of a response's phase at low tones, weighed by its certainty."""
    tones_hz, measured, variance, _ = _known(pool, response)
    low = tones_hz <= LOW_HZ
    if not low.any():
        return np.nan
    size = np.abs(measured[low])
    weight = 1.0 / (0.1**2 + 2.0 * variance[low] / np.square(size))
    return float(weight @ (measured[low].real / size) / weight.sum())


def _known(
    pool: Pool, response: ResponseName
) -> tuple[FloatArray, ComplexArray, FloatArray, FloatArray]:
    """Return tones, responses, variances and drives of all rows that say something."""
    friction = response == "friction"
    rows = [each.observed.rows for each in pool.trials]
    tones_hz = np.concatenate([each.tone_hz for each in rows])
    measured: ComplexArray = np.concatenate(
        [each.friction_response if friction else each.mobility for each in rows]
    )
    variance = np.concatenate(
        [each.friction_variance if friction else each.mobility_variance for each in rows]
    )
    drive = np.abs(np.concatenate([each.message for each in rows]))
    known = np.isfinite(measured) & (measured != 0.0) & np.isfinite(variance)
    return tones_hz[known], measured[known], variance[known], drive[known]


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
