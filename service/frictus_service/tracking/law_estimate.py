"""The law of the finger on the screen now: an iterated extended Kalman filter over windows.

The state is a person's law in `calibration.coordinates`. Between updates it walks at random: a
little with time, and the gain with every contact. Each update takes the windows of half a
second as `calibration.score_information` scores trials: the gain of a window wanders about that
of its contact, and the cutoff of all of them together about the law.

Bell and Cathey 1993, The iterated Kalman filter update as a Gauss-Newton method.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import BoolArray, ComplexArray, FloatArray
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.posterior import EXPECTED, wandered
from frictus_service.calibration.score_information import Data, GainScatter, scores, spread_of
from frictus_service.discovery.evidence.broadband import Bands
from frictus_service.tracking.windows import LawWindow

GAIN_PER_CONTACT: Final = 0.10
"""Standard deviation by which ln gain differs from one contact to the next; the simulated
participants' `WithinPersonScatter` takes the same."""
WALK: Final = np.array([0.003, 0.003, 0.005, 1e-7])
"""Standard deviation of the coordinates' random walk in a second: 2 % a minute is followed."""
LEAST_SD: Final = np.array([0.0, 0.0, 0.0, 5e-7])
"""However much was felt: a band's mean frequency stands for its lines, and a cutoff that
wanders leaves a little of itself in the delay."""
HEARD: Final = 1e-3
"""Share of the strongest band's power density below which a band says nothing: leakage."""
FORGETTING: Final = 0.05
"""Share of an update in the noise, once it is known."""
LEAST_NOISE_N2: Final = 1e-12
_STEPS: Final = 12
_FURTHEST: Final = np.array([0.5, 0.5, 0.5, 50e-6])
"""Longest step of Gauss-Newton."""


@dataclass(frozen=True, slots=True)
class LawEstimate:
    """What is known of the law.

    Attributes
    ----------
    mean : ndarray, shape (4,)
        In `calibration.coordinates`.
    covariance : ndarray, shape (4, 4)
    noise_n2 : ndarray, shape (n_bands,)
        Power of what the law does not explain of the friction, per frequency; NaN before the
        first update.
    gain_scatter : float
        Standard deviation of ln gain between windows of one contact.
    updates, windows : int
        That made it.
    """

    mean: FloatArray
    covariance: FloatArray
    noise_n2: FloatArray
    gain_scatter: float
    updates: int
    windows: int

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
        return cls(prior.mean, prior.covariance, nothing, 0.02, 0, 0)

    @property
    def half_width(self) -> FloatArray:
        """Half of the central 95 % interval of each coordinate, shape (4,)."""
        half: FloatArray = 1.96 * np.sqrt(np.diag(self.covariance) + np.square(LEAST_SD))
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

        speed = each("speed_mm_s")
        return cls(
            speed,
            np.array(
                [
                    np.full(bands.centre_hz.size, window.speed_mm_s)
                    if window.band_speed_mm_s is None
                    else window.band_speed_mm_s
                    for window in windows
                ]
            ),
            power,
            np.array([window.cross for window in windows]),
            np.array([window.friction_power for window in windows]),
            density > HEARD * density.max(axis=1, keepdims=True),
            bands,
            np.array(
                [
                    bands.centre_hz if window.frequency_hz is None else window.frequency_hz
                    for window in windows
                ]
            ),
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

    def rows(self, noise_n2: FloatArray) -> Data:
        """Return the responses and their variances, as calibration scores them.

        Half overlapping Hann windows count half, one frequency as 1.9 (`Bands.averages`).

        Parameters
        ----------
        noise_n2 : ndarray, shape (n_bands,)
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
            np.zeros(self.speed_mm_s.size, dtype=np.int64),
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
    walked = np.square(WALK) * max(seconds, 0.0)
    walked[2] += GAIN_PER_CONTACT**2 if new_contact else 0.0
    return replace(estimate, covariance=estimate.covariance + np.diag(walked))


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
        Squared distance from what was expected, in standard deviations of the estimate;
        above `calibration.posterior.STRANGE`: hardly the same finger.
    """
    noise = estimate.noise_n2
    if not estimate.updates:
        noise = np.maximum(_scatter(batch), LEAST_NOISE_N2)
    information = coordinates.inverse(estimate.covariance)
    data, weights = batch.rows(noise), np.ones(np.count_nonzero(batch.heard))
    spread = GainScatter(0.0, estimate.gain_scatter)
    at, total = estimate.mean, information
    for _ in range(2):  # scatter from the fit, weights from the scatter
        at, total = _settle(data, at, spread, weights, estimate.mean, information)
        scatter, weights = spread_of(data, at)
    away = at - estimate.mean
    share = max(1.0 / (estimate.updates + 1), FORGETTING)
    left = batch.unexplained(batch.law_response(at)).mean(axis=0)
    segment = (1.0 - share) * estimate.gain_scatter**2 + share * scatter.segment**2
    return (
        LawEstimate(
            at,
            coordinates.inverse(total),
            np.maximum((1.0 - share) * noise + share * left, LEAST_NOISE_N2),
            float(np.clip(np.sqrt(segment), 1e-3, 1.0)),
            estimate.updates + 1,
            estimate.windows + batch.speed_mm_s.size,
        ),
        float(away @ information @ away),
    )


def _settle(
    data: Data,
    at: FloatArray,
    spread: GainScatter,
    weights: FloatArray,
    mean: FloatArray,
    information: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return where Gauss-Newton ends and the information there."""
    for _ in range(_STEPS):
        _, score, own = wandered(*scores(data, at, spread, weights), EXPECTED)
        total = own[0] + information
        step = np.linalg.solve(total, score[0] + information @ (mean - at))
        step /= max(1.0, float(np.max(np.abs(step) / _FURTHEST)))
        at = at + step
        if step @ total @ step < 1e-4:
            break
    return at, total


def _scatter(batch: Batch) -> FloatArray:
    """Return the noise of a first batch: what its own mean response leaves."""
    power = batch.drive_power.sum(axis=0)
    own = batch.cross.sum(axis=0) / np.maximum(power, np.finfo(float).tiny)
    scatter: FloatArray = batch.unexplained(np.broadcast_to(own, batch.cross.shape)).mean(0)
    return scatter
