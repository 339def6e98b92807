"""How probable a batch of windows was before it was used, under one model of the law.

A proper score: noise as strong as the model has left so far, a gain that wanders by contact and
by window, a cutoff that wanders from batch to batch, and the uncertainty of the law itself.
Every second window: the others overlap.

Dawid 1984, Statistical theory: the prequential approach; Gneiting and Raftery 2007.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.posterior import EXPECTED
from frictus_service.calibration.score_information import linearised
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.finger_filters import CONTACTS
from frictus_service.tracking.estimation.law_estimate import (
    FORGETTING,
    LEAST_NOISE_N2,
    LawEstimate,
)
from frictus_service.tracking.evidence.innovations import SYSTEMATIC, UNITS

_WANDER: Final = np.zeros((4, 4))
_WANDER[:2, :2] = EXPECTED**2 * np.array([[1.0, 0.9], [0.9, 1.0]])
_WANDER[2, 2] = CONTACTS[-1] ** 2


def log_density(
    batch: Batch,
    at: FloatArray,
    covariance: FloatArray,
    noise_n2: FloatArray,
    gain_scatter: float,
) -> float:
    """Return the log density of a batch's responses, in nats.

    Parameters
    ----------
    batch : Batch
        That the model has not seen.
    at : ndarray, shape (4,)
        The law, in `calibration.coordinates`.
    covariance : ndarray, shape (4, 4)
        Of what is not known of it; zero for a model that is in force.
    noise_n2 : ndarray, shape (n_bands,)
        Power of what the model has left of the friction before, per frequency.
    gain_scatter : float
        Standard deviation of ln gain between windows.
    """
    data = batch.rows(noise_n2, at)
    used = data.segment % 2 == 0
    law = coordinates.response(at, data.speed_mm_s, data.tone_hz)
    columns = linearised(data, at)[1] * UNITS
    windows = data.segment[:, np.newaxis] == np.unique(data.segment[used])
    design = law[used, np.newaxis] * np.hstack([columns, windows])[used]
    left = (data.response - law)[used]
    # Half of the variance of overlapping windows, which count half.
    variance = data.variance[used] / 2.0 + np.square(SYSTEMATIC * np.abs(law[used]))
    root = np.sqrt(np.concatenate([variance, variance]))
    rows = np.concatenate([design.real, design.imag]) / root[:, np.newaxis]
    residual = np.concatenate([left.real, left.imag]) / root
    prior = np.diag(np.full(rows.shape[1], gain_scatter**2))
    prior[:4, :4] = _WANDER + covariance / np.outer(UNITS, UNITS)
    growth = np.eye(rows.shape[1]) + rows.T @ rows @ prior
    pull = rows.T @ residual
    explained = float(pull @ prior @ np.linalg.solve(growth, pull))
    size = float(np.linalg.slogdet(growth)[1]) + 2.0 * float(np.sum(np.log(root)))
    return -0.5 * (float(residual @ residual) - explained + size)


@dataclass(frozen=True, slots=True)
class PrequentialGain:
    """Log-likelihood of models over that of the first, each batch predicted before it is used.

    Attributes
    ----------
    noise_n2 : dict of str to ndarray, shape (n_bands,)
        By model: power of what it has left of the friction, per frequency.
    nats : dict of str to float
        By model, all batches so far.
    """

    noise_n2: dict[str, FloatArray]
    nats: dict[str, float]

    @classmethod
    def begin(cls) -> Self:
        """Return the gain before anything was predicted."""
        return cls({}, {})

    def without_noise_of(self, name: str) -> Self:
        """Return the gain with what a model has left forgotten: it is another one now.

        Parameters
        ----------
        name : str
            Of the model.
        """
        kept = {each: noise for each, noise in self.noise_n2.items() if each != name}
        return replace(self, noise_n2=kept)

    def judged(
        self, batch: Batch, models: Mapping[str, FloatArray], estimate: LawEstimate
    ) -> Self:
        """Return the gain after one more batch.

        Parameters
        ----------
        batch : Batch
            That no model has seen.
        models : mapping of str to ndarray, shape (4,)
            Laws by name, "first" among them; "newest" is the estimate.
        estimate : LawEstimate
            Before the batch.
        """
        noise, density = {}, {}
        for name, at in models.items():
            before = self.noise_n2.get(name, estimate.noise_n2)
            unknown = estimate.covariance * float(name == "newest")
            density[name] = log_density(batch, at, unknown, before, estimate.gain_scatter)
            left = batch.unexplained(batch.law_response(at)).mean(axis=0)
            kept = (1.0 - FORGETTING) * before + FORGETTING * left
            noise[name] = np.maximum(kept, LEAST_NOISE_N2)
        nats = {
            name: self.nats.get(name, 0.0) + density[name] - density["first"]
            for name in models
            if name != "first"
        }
        return type(self)(noise, self.nats | nats)
