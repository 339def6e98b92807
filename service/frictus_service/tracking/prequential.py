"""What a model is worth on windows that were not used for it: prediction before each update.

Dawid 1984, Statistical theory: the prequential approach.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.tracking.estimation.batch import Batch

REMEMBERED: Final = 20.0
"""Batches over which the error by band is averaged: 10 s."""
JUDGED: Final = 1e-2
"""Share of the strongest band's power below which a band's error is not judged."""


@dataclass(frozen=True, slots=True)
class PrequentialError:
    """How well one model, or a model that changes, has predicted; arrays of shape (n_bands,).

    Attributes
    ----------
    follows : ndarray of complex
        Remembered sum of predicted times measured friction, N².
    power : ndarray
        Remembered sum of the power of the prediction, N².
    measured_power : ndarray
        Likewise of the friction that was measured, N².
    count : float
        Remembered windows.
    """

    follows: ComplexArray
    power: FloatArray
    measured_power: FloatArray
    count: float

    @classmethod
    def begin(cls, n_bands: int) -> Self:
        """Return the error of a model before it predicted anything.

        Parameters
        ----------
        n_bands : int
            Of the windows.
        """
        nothing = np.zeros(n_bands)
        return cls(nothing.astype(complex), nothing, nothing, 0.0)

    def judged(self, batch: Batch, at: FloatArray) -> Self:
        """Return the error after one more batch.

        Parameters
        ----------
        batch : Batch
            That the model has not seen.
        at : ndarray, shape (4,)
            The model, in `calibration.coordinates`.
        """
        response = batch.law_response(at)
        keep = 1.0 - 1.0 / REMEMBERED
        predicted = np.square(np.abs(response)) * batch.drive_power
        return type(self)(
            follows=keep * self.follows + (response.conj() * batch.cross).sum(axis=0),
            power=keep * self.power + predicted.sum(axis=0),
            measured_power=keep * self.measured_power + batch.friction_power.sum(axis=0),
            count=keep * self.count + batch.speed_mm_s.size,
        )

    @property
    def band_db(self) -> FloatArray:
        """Measured over predicted friction by band, dB; NaN where too little was played.

        It is also the error of a rendering that undoes the model.
        """
        judged = self.power > JUDGED * max(float(self.power.max()), np.finfo(float).tiny)
        ratio = np.where(judged, np.abs(self.follows) / np.where(judged, self.power, 1.0), 1.0)
        return np.where(judged, 20.0 * np.log10(np.maximum(ratio, 1e-6)), np.nan)

    @property
    def band_half_width_db(self) -> FloatArray:
        """Half of the 95 % interval of `band_db`, from what the prediction leaves."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.follows / self.power
            left = self.measured_power / self.power - np.square(np.abs(ratio))
            sd = np.sqrt(np.maximum(left, 0.0) / np.maximum(self.count, 1.0))
            half: FloatArray = 1.96 * 20.0 / np.log(10.0) * sd / np.abs(ratio)
        return np.where(np.isfinite(self.band_db), half, np.nan)

    @property
    def rms_db(self) -> float:
        """Error over all bands that are judged, dB rms; NaN before anything was."""
        error = self.band_db
        judged = error[np.isfinite(error)]
        return float(np.sqrt(np.mean(np.square(judged)))) if judged.size else float("nan")
