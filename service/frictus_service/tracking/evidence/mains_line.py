"""Evidence of a line of the mains in the force: a likelihood ratio of one batch.

Windows of a batch, turned back by the mains' phase, add up; noise does not. Against noise as
strong as that of the neighbouring bands, doubled, and against a part of the drive that the law
may leave, so that neither a little colour of the noise nor a wrong law is seen as a line.
"""

from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.discovery.evidence.bands import WINDOW_S
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.law_estimate import LawEstimate
from frictus_service.tracking.windows import MAINS_HZ

AMPLITUDES_N: Final = np.geomspace(0.001, 0.05, 6)
"""That are tried."""
ROUGH: Final = 2.0
"""By how much the noise of a line may be above that of its neighbours, in power."""
LEFT: Final = 0.1
"""Part of the driven friction that a law may leave."""
MOST: Final = 4.0
"""Nats of one batch: a single knock raises no alarm."""
_HALF_OVERLAP: Final = 4.0 / 3.0
"""Variance of a sum of half overlapping Hann windows over that of independent ones."""


def line_evidence(batch: Batch, estimate: LawEstimate, sample_rate_hz: float) -> FloatArray:
    """Return the log likelihood ratio of a line of each frequency and amplitude.

    Parameters
    ----------
    batch : Batch
        That the estimate has not seen.
    estimate : LawEstimate
        Before the batch.
    sample_rate_hz : float
        Samples per second of the device's clock.

    Returns
    -------
    ndarray, shape (2, n_amplitudes)
        Of `windows.MAINS_HZ` and `AMPLITUDES_N`.
    """
    frequency = np.array(MAINS_HZ)
    law = coordinates.response(estimate.mean, batch.speed_mm_s[:, np.newaxis], frequency)
    driven = law * batch.mains_drive
    turn = np.exp(-2j * np.pi * 60.0 * batch.conditions.minutes[:, np.newaxis] * frequency)
    found = np.square(np.abs(np.sum((batch.mains_n - driven) * turn, axis=0)))
    near = (np.abs(batch.bands.centre_hz[:, np.newaxis] - frequency) < 25.0) & ~np.isin(
        np.rint(batch.bands.centre_hz), MAINS_HZ
    )[:, np.newaxis]
    noise = np.max(np.where(near, estimate.noise_n2[:, np.newaxis], 0.0), axis=0)
    noise = noise + LEFT**2 * np.square(np.abs(driven)).mean(axis=0)
    count = batch.speed_mm_s.size
    expected = ROUGH * _HALF_OVERLAP * count * np.maximum(noise, 1e-12)
    # A sinusoid of amplitude A has 0.408 A sqrt(n) in a Hann window of unit power.
    sinusoid = count**2 * np.square(AMPLITUDES_N) * sample_rate_hz * WINDOW_S / 6.0
    ratio = sinusoid / expected[:, np.newaxis]
    exceeds = (found / expected)[:, np.newaxis]
    evidence: FloatArray = np.minimum(exceeds * ratio / (1.0 + ratio) - np.log1p(ratio), MOST)
    return evidence
