"""Folds in time of one recording, each predicted from the others."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy import signal

from frictus_hardware.arrays import IntArray
from frictus_service.discovery.evidence.bands import RANGE_HZ, WINDOW_S
from frictus_service.discovery.evidence.observation_table import (
    ResponseName,
    UnitAssignment,
    dealt,
)
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.identification.observation.observe import course_of
from frictus_service.study.trial import Trial

MOST_FOLDS: Final = 10
LEAST_FOLDS: Final = 3
"""Two cannot say how much what they find scatters."""
TIMES: Final = 3.0
"""Correlation times between windows: what was random in one has fallen to a twentieth."""
LEAST_APART_S: Final = 0.02


def correlation_time_s(trial: Trial) -> float:
    """Return how long what is random in the friction of a trial resembles itself.

    The integral of the squared autocorrelation, one over the statistical bandwidth of the
    force in the analysed band: ``∫ S² df / (∫ S df)²`` (Bendat and Piersol, Random Data,
    chapter 8). Declared tones and their harmonics are left out.

    Parameters
    ----------
    trial : Trial
        As it was recorded.

    Returns
    -------
    float
        At most the length of a window of the spectra, which resolves no longer one.
    """
    rate_hz = trial.info.sample_rate_hz
    window = round(WINDOW_S * rate_hz)
    power, frequency = np.zeros(window // 2 + 1), np.fft.rfftfreq(window, 1.0 / rate_hz)
    for sweep in course_of(trial).sweeps:
        force = trial.force_n[int(sweep.begin_s * rate_hz) : int(sweep.end_s * rate_hz), 0]
        force = force[np.isfinite(force)]
        if force.size >= window:
            power += force.size * signal.welch(force, rate_hz, nperseg=window)[1]
    kept = (frequency >= RANGE_HZ[0]) & (frequency <= RANGE_HZ[1])
    for tone in trial.info.tones_hz:
        for order in (1, 2, 3):
            kept &= np.abs(frequency - order * tone) > 2.0 / WINDOW_S
    whole = power[kept].sum()
    if not whole > 0.0:
        return WINDOW_S
    found = float(np.square(power[kept]).sum() / whole**2 / (frequency[1] - frequency[0]))
    return min(found, WINDOW_S)


def folds_of(windows: Sequence[TrialEvidence], response: ResponseName) -> UnitAssignment:
    """Return the fold of each window.

    Folds are stretches of time where all windows show the same tones or bands; else windows
    are dealt out, so that each fold has all tones, as far as `LEAST_FOLDS` can have them.

    Parameters
    ----------
    windows : sequence of TrialEvidence
        Those that say something of the response, in time; `LEAST_FOLDS` of them at least.
    response : {'friction', 'mobility'}
    """
    count = min(MOST_FOLDS, len(windows))
    tones = [one.observed.info.tones_hz for one in windows]
    if len(set(tones)) == 1:
        of_window: IntArray = np.arange(len(windows)) * count // max(len(windows), 1)
    else:
        fewest = min(tones.count(each) for each in set(tones))
        count = max(min(count, fewest), LEAST_FOLDS)
        of_window = dealt(tones, count)
    people = [one.observed.info.participant for one in windows]
    names = tuple(f"fold {number + 1}" for number in range(count))
    return UnitAssignment(names, (people[0] if people else "",) * count, of_window, "blocks")
