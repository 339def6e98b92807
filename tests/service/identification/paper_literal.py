"""The paper's data processing to the letter, as a comparison only: its answers are biased.

Section 2.4 and Appendix B: lateral force by DFT321, sweeps where friction is above its mean,
4000 samples about the middle of each, the message from the upper sideband of the voltage, all
from the nearest bin of a Fourier transform; then a first-order magnitude, the setup's response
beside it, fitted without a delay to all sweeps and tones of a condition.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
from scipy import optimize

from frictus_hardware.arrays import FloatArray
from frictus_service.study.trial import StudyInfo, Trial

Condition = tuple[str, float, float]

WINDOW = 4000


def literal_cutoffs(trials: Iterable[Trial], study: StudyInfo) -> dict[Condition, float]:
    """Return the cutoff in Hz per participant, speed and force, as the paper would find it."""
    points: dict[Condition, list[tuple[float, float]]] = defaultdict(list)
    for trial in trials:
        asked = trial.info
        if trial.voltage_v is None or not asked.tones_hz:
            continue
        condition = (asked.participant, asked.speed_mm_s, asked.force_n)
        for gain in _gains(trial, trial.voltage_v, study.carrier_hz):
            points[condition].append((asked.tones_hz[0], gain))
    return {
        condition: _cutoff_hz(np.array(found), study)
        for condition, found in points.items()
        if len({tone for tone, _ in found}) >= 3
    }


def _gains(trial: Trial, voltage_v: FloatArray, carrier_hz: float) -> Iterator[float]:
    friction = _dft321(trial.force_n[:, :2])
    tone, rate = trial.info.tones_hz[0], trial.info.sample_rate_hz
    for part in _sweeps(trial.force_n[:, 0]):
        drive = _nearest_bin(voltage_v[part], carrier_hz + tone, rate)
        yield _nearest_bin(friction[part], tone, rate) / drive


def _dft321(axes: FloatArray) -> FloatArray:
    """Reduce axes to one by the size of their spectra together and the phase of their sum."""
    filled = np.nan_to_num(axes)
    spectra = np.fft.rfft(filled, axis=0)
    size = np.sqrt(np.square(np.abs(spectra)).sum(axis=1))
    reduced: FloatArray = np.fft.irfft(
        size * np.exp(1j * np.angle(spectra.sum(axis=1))), filled.shape[0]
    )
    return reduced


def _sweeps(friction_n: FloatArray) -> Iterator[slice]:
    above = friction_n > np.nanmean(friction_n)
    edges = [0, *(np.flatnonzero(np.diff(above.astype(np.int8))) + 1), above.size]
    for begin, end in pairwise(edges):
        middle = (begin + end) // 2
        if above[middle] and end - begin >= WINDOW:
            yield slice(middle - WINDOW // 2, middle + WINDOW // 2)


def _nearest_bin(samples: FloatArray, frequency_hz: float, rate_hz: float) -> float:
    spectrum = np.fft.rfft(np.nan_to_num(samples))
    return float(np.abs(spectrum[round(frequency_hz * samples.size / rate_hz)]))


def _cutoff_hz(points: FloatArray, study: StudyInfo) -> float:
    tone_hz, gain = points.T
    setup = np.ones(tone_hz.size)
    if study.mount is not None:
        setup = np.abs(study.mount.frequency_response(tone_hz))

    def residual(logs: FloatArray) -> FloatArray:
        model = np.exp(logs[0]) / np.sqrt(1.0 + np.square(tone_hz / np.exp(logs[1])))
        return np.asarray(np.log(model * setup / gain))

    start = np.array([np.log(np.median(gain)), np.log(1000.0)])
    bounds = ([-np.inf, np.log(10.0)], [np.inf, np.log(1e5)])
    return float(np.exp(optimize.least_squares(residual, start, bounds=bounds).x[1]))
