"""Windows that a filter takes together: half a second of one contact, as rows of arrays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_service.calibration import coordinates
from frictus_service.calibration.score_information import Data
from frictus_service.discovery.evidence.bands import Bands
from frictus_service.tracking.estimation.speed_spread import SpeedSpread
from frictus_service.tracking.windows import LawWindow

HEARD: Final = 1e-3
"""Share of the strongest band's power density below which a band says nothing: leakage."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Windows that are taken together; arrays of shape (n_windows, n_bands).

    Attributes
    ----------
    speed_mm_s : ndarray, shape (n_windows,)
        Mean of each window, without sign.
    band_speed_mm_s : ndarray of complex
        At which the drive of each band was felt (`LawWindow`).
    drive_power, friction_power : ndarray
        Of the drive fraction, and of the friction in N².
    cross : ndarray of complex
        Conjugate of the drive times friction, N.
    heard : ndarray of bool
        Where the drive is strong enough to say something.
    bands : Bands
        They speak in.
    frequency_hz, frequency_variance_hz2 : ndarray of complex
        Mean and variance in each band, weighted by the drive (`band_frequencies`).
    conditions : SlidingConditions
        Of each window; minutes since the device began.
    drive_mean, drive_variance : ndarray, shape (n_windows,)
        Of the drive fraction.
    mains_n, mains_drive : ndarray of complex, shape (n_windows, 2)
        Of the force along x and of the drive, at `windows.MAINS_HZ`.
    """

    speed_mm_s: FloatArray
    band_speed_mm_s: ComplexArray
    drive_power: FloatArray
    cross: ComplexArray
    friction_power: FloatArray
    heard: BoolArray
    bands: Bands
    frequency_hz: ComplexArray
    frequency_variance_hz2: ComplexArray
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

        def by_band(name: str, otherwise: FloatArray) -> ComplexArray:
            known = (getattr(window, name) for window in windows)
            return np.array(
                [
                    value if found is None else found
                    for found, value in zip(known, otherwise, strict=True)
                ],
                dtype=np.complex128,
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
            by_band("frequency_variance_hz2", none),
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

    def at_speeds_of(self, spread: SpeedSpread) -> Self:
        """Return the windows with the speeds by which a law may be told.

        Parameters
        ----------
        spread : SpeedSpread
            Of the finger, these windows included.
        """
        keeping = spread.keeping(self.speed_mm_s)
        speed_mm_s = np.where(keeping, spread.mean_mm_s, self.speed_mm_s)
        of_bands = np.where(keeping[:, np.newaxis], spread.mean_mm_s, self.band_speed_mm_s)
        conditions = replace(self.conditions, speed_mm_s=speed_mm_s)
        return replace(
            self, speed_mm_s=speed_mm_s, band_speed_mm_s=of_bands, conditions=conditions
        )

    @property
    def coherence(self) -> float:
        """Of drive and friction over all that is heard; 1: friction follows the drive alone."""
        cross = np.sum(self.cross, axis=0, where=self.heard)
        power = np.sum(self.drive_power, axis=0, where=self.heard)
        felt = np.sum(self.friction_power, axis=0, where=self.heard)
        explained = np.square(np.abs(cross)) / np.maximum(power, np.finfo(float).tiny)
        return float(explained.sum() / max(float(felt.sum()), np.finfo(float).tiny))

    def opposes(self, at: FloatArray) -> bool:
        """Return whether friction falls where a law has it rise: no gain is so, however small.

        Parameters
        ----------
        at : ndarray, shape (4,)
            In `calibration.coordinates`.
        """
        along = (self.law_response(at).conj() * self.cross).real
        return bool(np.sum(along, where=self.heard) < 0.0)

    def law_response(self, at: FloatArray) -> ComplexArray:
        """Return a law's response in each window and band, N (Equation 4, and the delay).

        To second order in how the frequencies of a band differ (`band_frequencies`).

        Parameters
        ----------
        at : ndarray, shape (4,)
            In `calibration.coordinates`.
        """
        where = (at, self.band_speed_mm_s, self.frequency_hz)
        bent = 0.5 * coordinates.curvature_per_hz2(*where) * self.frequency_variance_hz2
        response: ComplexArray = coordinates.response(*where) * (1.0 + bent)
        return response

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

    def rows(self, noise_n2: FloatArray, at: FloatArray, part: IntArray | None = None) -> Data:
        """Return the responses and their variances, as calibration scores them.

        Those at real frequencies and speeds: a law tells how a band's own lie beside them.
        Half overlapping Hann windows count half, one frequency as 1.9 (`Bands.averages`).

        Parameters
        ----------
        noise_n2 : ndarray, shape (n_bands,)
        at : ndarray, shape (4,)
            That law, in `calibration.coordinates`; about the one that is looked for.
        part : ndarray of int, shape (n_windows,), optional
            Number of each window's trial, rising from 0; None: all are of one.
        """
        window, band = np.nonzero(self.heard)
        power = self.drive_power[window, band]
        share = (self.bands.lines / (self.bands.lines + 0.9))[band]
        speed_mm_s = self.band_speed_mm_s[window, band].real
        frequency_hz = self.frequency_hz[window, band].real
        beside = coordinates.response(at, speed_mm_s, frequency_hz)
        beside /= self.law_response(at)[window, band]
        return Data(
            speed_mm_s,
            frequency_hz,
            self.cross[window, band] / power * beside,
            noise_n2[band] * share / power,
            window,
            np.zeros(self.speed_mm_s.size, dtype=np.int64) if part is None else part,
            np.zeros(1, dtype=np.int64),
            self.bands.centre_hz[band],
        )
