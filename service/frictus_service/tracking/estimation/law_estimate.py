"""The law of the finger on the screen now: iterated extended Kalman filters over windows.

What may vary between updates is in `finger_filters`. Each update takes the windows of
half a second as `calibration.score_information` scores trials: the gain of a window wanders
about that of its contact.

Bell and Cathey 1993, The iterated Kalman filter update as a Gauss-Newton method.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.posterior import wandered
from frictus_service.calibration.score_information import (
    Data,
    GainScatter,
    response,
    scores,
    spread_of,
)
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.finger_filters import FELT, NOW, PERSON, FingerFilters
from frictus_service.tracking.estimation.speed_spread import SpeedSpread
from frictus_service.tracking.estimation.strokes import Strokes

RESPONSE_WITHIN: Final = 1e-3
"""Relative error of a response that no average makes smaller: a band's mean speed stands for
those within it, and a window is not infinitely long."""
GAIN_WITHIN: Final = 4e-4
"""Likewise of a gain. Friction is projected on the motion that touch reports tell, which
resolve no tremor: 0.02 mm across the stroke at 10 Hz are 1.3 mm/s, which turn friction away at
50 mm/s by an angle whose cosine is so much below 1."""
HIGHEST_HZ: Final = 1e3
"""About the highest band that a texture drives: what it tells of a cutoff and of a delay."""
CUTOFF_PER_WINDOW: Final = 0.01
"""Standard deviation of ln cutoff between windows: their speed is not known exactly."""
FORGETTING: Final = 0.05
"""Share of an update in the noise, once it is known."""
LEAST_NOISE_N2: Final = 1e-12
OFF_ALIKE: Final = 60
"""Updates in a row, half a minute of one tone, whose responses are off alike by what is not
linear in ln cutoff: no average of so many makes that smaller."""
_STEPS: Final = 12
_FURTHEST: Final = np.array([0.5, 0.5, 0.5, 50e-6])
"""Longest step of Gauss-Newton."""


@dataclass(frozen=True)
class LawEstimate:
    """What is known of the law.

    Attributes
    ----------
    filters : FingerFilters
        Of the person's law, and of how far off it this contact is.
    noise_n2 : ndarray, shape (n_bands,)
        Power of what the law does not explain of the friction, per frequency; NaN before the
        first update.
    gain_scatter : float
        Standard deviation of ln gain between windows of one contact.
    updates, windows : int
        That made it.
    last_direction, last_minutes : float
        Of the last window, by which strokes are told; 0 before the first.
    speeds : SpeedSpread
        Of the windows.
    tangent_at : ndarray, shape (4,), or None
        The law after the first update: where it is taken to be linear in the cutoff of a finger
        that keeps to one speed.
    """

    filters: FingerFilters
    noise_n2: FloatArray
    gain_scatter: float
    updates: int
    windows: int
    last_direction: float = 0.0
    last_minutes: float = 0.0
    speeds: SpeedSpread = field(default_factory=SpeedSpread)
    tangent_at: FloatArray | None = None

    @classmethod
    def begin(cls, prior: Prior, n_bands: int) -> Self:
        """Return what is known before anything was felt.

        Parameters
        ----------
        prior : Prior
            Of a new person.
        n_bands : int
            Of the windows.
        """
        nothing = np.full(n_bands, np.nan)
        return cls(FingerFilters.begin(prior), nothing, 0.02, 0, 0)

    @property
    def mean(self) -> FloatArray:
        """The law of this contact in `calibration.coordinates`, shape (4,)."""
        return self._now[0]

    @property
    def covariance(self) -> FloatArray:
        """Covariance of `mean`, shape (4, 4)."""
        return self._now[1]

    @cached_property
    def _now(self) -> tuple[FloatArray, FloatArray]:
        return self._known(NOW)

    @cached_property
    def person(self) -> tuple[FloatArray, FloatArray]:
        """The person's law, about which contacts lie: mean (4,) and covariance (4, 4)."""
        return self._known(PERSON)

    def _known(self, combination: FloatArray) -> tuple[FloatArray, FloatArray]:
        mean, covariance = self.filters.of(combination)
        cutoff = np.exp(mean[:2])
        least = RESPONSE_WITHIN * np.append(
            np.hypot(cutoff / HIGHEST_HZ, 1.0), [0.0, 0.5 / np.pi / HIGHEST_HZ]
        )
        least[2] = GAIN_WITHIN
        ends = np.array([coordinates.LOW_MM_S, coordinates.HIGH_MM_S])
        slope = (cutoff[1] - cutoff[0]) / (ends[1] - ends[0])
        steeper = self.speeds.attenuation * slope * (ends - self.speeds.mean_mm_s) / cutoff
        flat = np.append(steeper, [0.0, 0.0])
        return mean, covariance + np.diag(np.square(least)) + np.outer(flat, flat)

    def sliding_at(self, speed_mm_s: FloatArray) -> Self:
        """Return what is known, of a finger that slid at further speeds.

        Parameters
        ----------
        speed_mm_s : ndarray, shape (n_windows,)
            Of windows that are about to be used.
        """
        return replace(self, speeds=self.speeds.seen(speed_mm_s))

    @property
    def half_width(self) -> FloatArray:
        """Half of the central 95 % interval of each coordinate, shape (4,)."""
        half: FloatArray = 1.96 * np.sqrt(np.diag(self.covariance))
        return half


def advanced(estimate: LawEstimate, seconds: float, new_contact: bool) -> LawEstimate:
    """Return what is still known after some time.

    Parameters
    ----------
    estimate : LawEstimate
        After the last update.
    seconds : float
        Since the last update.
    new_contact : bool
        Whether the finger left the screen meanwhile.
    """
    return replace(estimate, filters=estimate.filters.advanced(seconds, new_contact))


def updated(estimate: LawEstimate, batch: Batch) -> tuple[LawEstimate, float]:
    """Return what is known after a batch, and how strange the batch was.

    Parameters
    ----------
    estimate : LawEstimate
        Advanced to the batch.
    batch : Batch
        Windows that it has not seen.

    Returns
    -------
    LawEstimate
    float
        Squared distance from what was expected, in standard deviations
        (`FingerFilters.seen`); above `calibration.posterior.STRANGE`: hardly the same finger.
    """
    noise = estimate.noise_n2
    if not estimate.updates:
        noise = np.maximum(_scatter(batch), LEAST_NOISE_N2)
    mean, covariance = estimate.filters.of(FELT)
    information = coordinates.inverse(covariance)
    strokes = Strokes.of(batch.conditions, estimate.last_direction, estimate.last_minutes)
    data, weights = (
        batch.rows(noise, mean, strokes.part),
        np.ones(np.count_nonzero(batch.heard)),
    )
    at = mean
    for _ in range(2):  # scatter from the fit, weights from the scatter
        at = _settle(data, at, estimate.gain_scatter, weights, mean, information)
        scatter, weights = spread_of(data, at)
    total = _scores(data, at, estimate.gain_scatter, weights)[1].sum(axis=0) + information
    data = _as_far_as_linear(data, at, coordinates.inverse(total))
    filters, strange = estimate.filters, 0.0
    of_parts = _scores(data, at, estimate.gain_scatter, weights)
    tangent_at = at if estimate.tangent_at is None else estimate.tangent_at
    if estimate.speeds.steady:
        of_parts = _along_one_cutoff(*of_parts, at, tangent_at, estimate.speeds.mean_mm_s)
    for begins, score, own in zip(strokes.begins, *of_parts, strict=True):
        filters = filters.of_another_stroke() if begins else filters
        filters, away = filters.seen(score, own, at)
        strange = max(strange, away)
    share = max(1.0 / (estimate.updates + 1), FORGETTING)
    left = batch.unexplained(batch.law_response(at)).mean(axis=0)
    segment = (1.0 - share) * estimate.gain_scatter**2 + share * scatter.segment**2
    found = LawEstimate(
        filters,
        np.maximum((1.0 - share) * noise + share * left, LEAST_NOISE_N2),
        float(np.clip(np.sqrt(segment), 1e-3, 1.0)),
        estimate.updates + 1,
        estimate.windows + batch.speed_mm_s.size,
        float(batch.conditions.direction[-1]),
        float(batch.conditions.minutes[-1]),
        estimate.speeds,
        tangent_at,
    )
    return found, strange


def _settle(
    data: Data,
    at: FloatArray,
    gain_scatter: float,
    weights: FloatArray,
    mean: FloatArray,
    information: FloatArray,
) -> FloatArray:
    """Return where Gauss-Newton ends."""
    for _ in range(_STEPS):
        score, own = _scores(data, at, gain_scatter, weights)
        total = own.sum(axis=0) + information
        step = np.linalg.solve(total, score.sum(axis=0) + information @ (mean - at))
        step /= max(1.0, float(np.max(np.abs(step) / _FURTHEST)))
        at = at + step
        if step @ total @ step < 1e-4:
            break
    return at


def _as_far_as_linear(data: Data, at: FloatArray, covariance: FloatArray) -> Data:
    """Return responses that are known no better than a law is linear in what is left unknown.

    A tone alone does not tell gain from cutoff. Where it is taken to be linear in both, a later
    one, with which the law moves along what both leave open, would find it wrong, and be too
    certain: the square of a normal error has a mean square of three times its variance squared.

    Parameters
    ----------
    data : Data
        With the variance of their noise.
    at : ndarray, shape (4,)
        Where the law is taken to be linear.
    covariance : ndarray, shape (4, 4)
        Of what is known with these data.
    """
    gradient = coordinates.cutoff_gradient(at, data.speed_mm_s)
    variance = np.einsum("ni,ij,nj->n", gradient, covariance, gradient)
    cutoff = coordinates.cutoff_hz(at, data.speed_mm_s)
    share = 1j * data.tone_hz / (cutoff + 1j * data.tone_hz)
    law = response(data, at)
    bent = 0.5 * np.abs(share * (1.0 - share) * law) * variance
    return replace(data, variance=data.variance + 3.0 * OFF_ALIKE * np.square(bent))


def _scores(
    data: Data, at: FloatArray, gain_scatter: float, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return score and information of each part in a stroke, (n_parts, 4) and (n_parts, 4, 4).

    Gain and cutoff differ from window to window.
    """
    each = replace(data, trial_of_segment=np.arange(data.n_segments))
    score, own = scores(each, at, GainScatter(gain_scatter, 0.0), weights)
    _, score, own = wandered(score, own, CUTOFF_PER_WINDOW)
    begins = np.flatnonzero(np.diff(data.trial_of_segment, prepend=-1))
    return np.add.reduceat(score, begins), np.add.reduceat(own, begins)


def _along_one_cutoff(
    score: FloatArray,
    information: FloatArray,
    at: FloatArray,
    tangent_at: FloatArray,
    speed_mm_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Return score and information of the cutoff at one speed, always along one direction.

    How much the cutoffs at both ends count at a speed depends a little on the law. Taken where
    the law is now, what is known along a direction that turns is little by little taken to be
    known of the slope, too (Huang, Mourikis, Roumeliotis 2010: first-estimates Jacobians).

    Parameters
    ----------
    score, information : ndarray, shape (n_parts, 4), (n_parts, 4, 4)
        Taken at `at`.
    at, tangent_at : ndarray, shape (4,)
        Where the law is now, and where it is taken to be linear.
    speed_mm_s : float
        Of all windows.
    """
    now, fixed = (
        coordinates.cutoff_gradient(each, np.array([speed_mm_s]))[0, :2]
        for each in (at, tangent_at)
    )
    turned = np.eye(coordinates.SIZE)
    turned[:2, :2] = np.outer(fixed, now) / (now @ now)
    return score @ turned.T, turned @ information @ turned.T


def _scatter(batch: Batch) -> FloatArray:
    """Return the noise of a first batch: what its own mean response leaves."""
    power = batch.drive_power.sum(axis=0)
    own = batch.cross.sum(axis=0) / np.maximum(power, np.finfo(float).tiny)
    scatter: FloatArray = batch.unexplained(np.broadcast_to(own, batch.cross.shape)).mean(0)
    return scatter
