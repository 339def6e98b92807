"""Identification as one writes it down first, to be timed: FFTs of each trial, `curve_fit`.

It follows the paper's data processing: axes reduced by DFT321, acceleration integrated, sweeps
where friction is above its mean, 4000 samples in the middle of each, the nearest bin of their
spectra, magnitudes fitted. Its answers are biased; nothing else uses it.
"""

from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from scipy import integrate, optimize

from frictus_hardware.arrays import FloatArray

WINDOW: Final = 4000


def cutoffs_hz(path: Path) -> dict[tuple[float, float], float]:
    """Return a cutoff per speed and force.

    Parameters
    ----------
    path : Path
        A `study/1` file.
    """
    points: dict[tuple[float, float], list[tuple[float, float]]] = defaultdict(list)
    with h5py.File(path) as file:
        for trial in file["trials"].values():
            asked = trial.attrs
            tone = float(np.ravel(asked["tone_hz"])[0])
            for gain in _gains(trial, tone):
                points[float(asked["speed_mm_s"]), float(asked["force_n"])].append((tone, gain))
    return {condition: _fit(np.array(found)) for condition, found in points.items()}


def _gains(trial: Any, tone_hz: float) -> list[float]:
    rate_hz = float(trial.attrs["sample_rate_hz"])
    voltage, force, accel = (_read(trial[n]) for n in ("voltage_v", "force_n", "accel_m_s2"))
    friction = _dft321(force[:, :2])
    velocity = integrate.cumulative_trapezoid(_dft321(accel), dx=1.0 / rate_hz)
    drive = 2.0 * np.square(voltage / 75.0)
    above = force[:, 0] > force[:, 0].mean()
    edges = np.flatnonzero(np.diff(above.astype(np.int8)))
    gains = []
    for begin, end in pairwise(edges):
        middle = (begin + end) // 2
        if not above[middle] or end - begin < WINDOW:
            continue
        part = slice(middle - WINDOW // 2, middle + WINDOW // 2)
        spectra = [np.abs(np.fft.rfft(each[part])) for each in (drive, friction, velocity)]
        line = round(tone_hz * WINDOW / rate_hz)
        gains.append(float(spectra[1][line] / spectra[0][line]))
    return gains


def _read(data_set: Any) -> FloatArray:
    raw = data_set[()]
    if raw.dtype.kind == "f":
        return np.asarray(raw, dtype=np.float64)
    return np.asarray(raw * data_set.attrs["scale"] + data_set.attrs.get("offset", 0.0))


def _dft321(axes: FloatArray) -> FloatArray:
    spectra = np.fft.rfft(axes, axis=0)
    size = np.sqrt(np.square(np.abs(spectra)).sum(axis=1))
    phase = np.angle(spectra.sum(axis=1))
    reduced: FloatArray = np.fft.irfft(size * np.exp(1j * phase), axes.shape[0])
    return reduced


def _fit(points: FloatArray) -> float:
    def first_order(tone_hz: FloatArray, gain: float, cutoff_hz: float) -> FloatArray:
        return gain / np.sqrt(1.0 + np.square(tone_hz / cutoff_hz))

    if points.shape[0] < 3:
        return float("nan")
    solved = optimize.curve_fit(
        first_order, points[:, 0], points[:, 1], (0.4, 1000.0), maxfev=5000
    )
    return float(solved[0][1])
