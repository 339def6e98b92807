"""The law of the finger on the screen now: iterated extended Kalman filters over windows.

What may vary between updates is in `tracking.finger_filters`. Each update takes the windows of
half a second as `calibration.score_information` scores trials: the gain of a window wanders
about that of its contact.

Bell and Cathey 1993, The iterated Kalman filter update as a Gauss-Newton method.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.posterior import wandered
from frictus_service.calibration.score_information import Data, GainScatter, scores, spread_of
from frictus_service.discovery.evidence.bands import Bands
from frictus_service.tracking.finger_filters import FELT, NOW, PERSON, FingerFilters
from frictus_service.tracking.strokes import Strokes
from frictus_service.tracking.windows import LawWindow

RESPONSE_WITHIN: Final = 1e-3
"""Relative error of a response that no average makes smaller: a band's mean frequency stands
for its lines, and a window is not infinitely long."""
HIGHEST_HZ: Final = 1e3
"""About the highest band that a texture drives: what it tells of a cutoff and of a delay."""
CUTOFF_PER_WINDOW: Final = 0.01
"""Standard deviation of ln cutoff between windows: their speed is not known exactly."""
HEARD: Final = 1e-3
"""Share of the strongest band's power density below which a band says nothing: leakage."""
FORGETTING: Final = 0.05
"""Share of an update in the noise, once it is known."""
LEAST_NOISE_N2: Final = 1e-12
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
    """

    filters: FingerFilters
    noise_n2: FloatArray
    gain_scatter: float
    updates: int
    windows: int
    last_direction: float = 0.0
    last_minutes: float = 0.0

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
        least = np.append(np.hypot(cutoff / HIGHEST_HZ, 1.0), [0.0, 0.5 / np.pi / HIGHEST_HZ])
        return mean, covariance + np.diag(np.square(RESPONSE_WITHIN * least))

    @property
    def half_width(self) -> FloatArray:
        """Half of the central 95 % interval of each coordinate, shape (4,)."""
        half: FloatArray = 1.96 * np.sqrt(np.diag(self.covariance))
        return half


@dataclass(frozen=True, slots=True)
class Batch:
    """Windows that are taken together; arrays of shape (n_windows, n_bands).

    Attributes
    ----------
    speed_mm_s : ndarray, shape (n_windows,)
        Mean of each window, without sign.
    band_speed_mm_s : ndarray
        At which the drive of each band was felt.
    drive_power, friction_power : ndarray
        Of the drive fraction, and of the friction in N².
    cross : ndarray of complex
        Conjugate of the drive times friction, N.
    heard : ndarray of bool
        Where the drive is strong enough to say something.
    bands : Bands
        They speak in.
    frequency_hz : ndarray
        Mean in each band, weighted by the drive's power.
    conditions : SlidingConditions
        Of each window; minutes since the device began.
    drive_mean, drive_variance : ndarray, shape (n_windows,)
        Of the drive fraction.
    mains_n, mains_drive : ndarray of complex, shape (n_windows, 2)
        Of the force along x and of the drive, at `windows.MAINS_HZ`.
    """

    speed_mm_s: FloatArray
    band_speed_mm_s: FloatArray
    drive_power: FloatArray
    cross: ComplexArray
    friction_power: FloatArray
    heard: BoolArray
    bands: Bands
    frequency_hz: FloatArray
    conditions: SlidingConditions
    drive_mean: FloatArray
    drive_variance: FloatArray
    mains_n: ComplexArray
    mains_drive: ComplexArray

    @classmethod
    def of(cls, windows: Sequence[LawWindow], bands: Bands) -> Self:
        """Collect windows, one or more, of one contact.

        Parameters
        ----------
        windows : sequence of LawWindow
            In order.
        bands : Bands
            They speak in.
        """
        power = np.array([window.drive_power for window in windows])
        density = power / bands.lines

        def each(name: str) -> FloatArray:
            return np.array([getattr(window, name) for window in windows])

        def by_band(name: str, otherwise: FloatArray) -> FloatArray:
            known = (getattr(window, name) for window in windows)
            return np.array(
                [
                    value if found is None else found
                    for found, value in zip(known, otherwise, strict=True)
                ]
            )

        speed, none = each("speed_mm_s"), np.zeros(power.shape)
        return cls(
            speed,
            by_band("band_speed_mm_s", none + speed[:, np.newaxis]),
            power,
            np.array([window.cross for window in windows]),
            np.array([window.friction_power for window in windows]),
            density > HEARD * density.max(axis=1, keepdims=True),
            bands,
            by_band("frequency_hz", none + bands.centre_hz),
            SlidingConditions(
                speed,
                each("normal_force_n"),
                each("position_mm"),
                each("direction"),
                each("minutes"),
            ),
            each("drive_mean"),
            each("drive_variance"),
            np.array([window.mains_n for window in windows]),
            np.array([window.mains_drive for window in windows]),
        )

    @property
    def coherence(self) -> float:
        """Of drive and friction over all that is heard; 1: friction follows the drive alone."""
        cross = np.sum(self.cross, axis=0, where=self.heard)
        power = np.sum(self.drive_power, axis=0, where=self.heard)
        felt = np.sum(self.friction_power, axis=0, where=self.heard)
        explained = np.square(np.abs(cross)) / np.maximum(power, np.finfo(float).tiny)
        return float(explained.sum() / max(float(felt.sum()), np.finfo(float).tiny))

    def law_response(self, at: FloatArray) -> ComplexArray:
        """Return a law's response in each window and band, N (Equation 4, and the delay).

        Parameters
        ----------
        at : ndarray, shape (4,)
            In `calibration.coordinates`.
        """
        return coordinates.response(at, self.band_speed_mm_s, self.frequency_hz)

    def unexplained(self, response: ComplexArray) -> FloatArray:
        """Return the power of the friction that a response leaves, per frequency, N².

        Parameters
        ----------
        response : ndarray of complex, shape (n_windows, n_bands)
        """
        left = self.friction_power - 2.0 * (response.conj() * self.cross).real
        left += np.square(np.abs(response)) * self.drive_power
        density: FloatArray = np.maximum(left, 0.0) / self.bands.lines
        return density

    def rows(self, noise_n2: FloatArray, part: IntArray | None = None) -> Data:
        """Return the responses and their variances, as calibration scores them.

        Half overlapping Hann windows count half, one frequency as 1.9 (`Bands.averages`).

        Parameters
        ----------
        noise_n2 : ndarray, shape (n_bands,)
        part : ndarray of int, shape (n_windows,), optional
            Number of each window's trial, rising from 0; None: all are of one.
        """
        window, band = np.nonzero(self.heard)
        power = self.drive_power[window, band]
        share = (self.bands.lines / (self.bands.lines + 0.9))[band]
        return Data(
            self.band_speed_mm_s[window, band],
            self.frequency_hz[window, band],
            self.cross[window, band] / power,
            noise_n2[band] * share / power,
            window,
            np.zeros(self.speed_mm_s.size, dtype=np.int64) if part is None else part,
            np.zeros(1, dtype=np.int64),
            self.bands.centre_hz[band],
        )


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
    data, weights = batch.rows(noise, strokes.part), np.ones(np.count_nonzero(batch.heard))
    at = mean
    for _ in range(2):  # scatter from the fit, weights from the scatter
        at = _settle(data, at, estimate.gain_scatter, weights, mean, information)
        scatter, weights = spread_of(data, at)
    filters, strange = estimate.filters, 0.0
    of_parts = _scores(data, at, estimate.gain_scatter, weights)
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


def _scatter(batch: Batch) -> FloatArray:
    """Return the noise of a first batch: what its own mean response leaves."""
    power = batch.drive_power.sum(axis=0)
    own = batch.cross.sum(axis=0) / np.maximum(power, np.finfo(float).tiny)
    scatter: FloatArray = batch.unexplained(np.broadcast_to(own, batch.cross.shape)).mean(0)
    return scatter
