"""Whether the finger answered linearly during a quick calibration."""

from collections.abc import Iterable, Iterator
from typing import Any, Final

import numpy as np

from frictus.messages import Excitation, Tone
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration.design import BASE_HZ
from frictus_service.calibration.errors import ExcitationDesignError
from frictus_service.calibration.nonlinearity import Distortion, nonlinearity
from frictus_service.identification.observation.sweeps import find_sweeps, smooth
from frictus_service.study.trial import Trial

SURE: Final = 0.01
"""Distortion is noted where noise alone would show as much less often than this,"""
LARGE: Final = 0.01
"""and where it is so large a share of the tones: below, no rendering suffers from it."""
WHAT: Final = {"even": "a square of the drive", "odd": "a cube of the drive, or a limit"}


def linearity_of(trials: Iterable[Trial]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return what stands at the lines between the tones, and what is to be noted of it.

    Parameters
    ----------
    trials : iterable of Trial
        With the same odd multisine's tones, whatever their phases.

    Returns
    -------
    details : dict
        Level over that of the tones and p value, of even and of odd lines; empty where no
        sweep lasts long enough to tell.
    notes : tuple of str
    """
    stretches: list[FloatArray] = []
    asked = None
    for trial in trials:
        asked = trial.info
        stretches += stretches_of(trial)
    if asked is None:
        return {}, ()
    tones = [Tone(hz=hz, amplitude=0.1) for hz in asked.tones_hz]
    lines = Excitation(tones=tones, period_s=1.0 / BASE_HZ)
    try:
        found = nonlinearity(stretches, lines, asked.sample_rate_hz)
    except ExcitationDesignError as error:
        return {}, (f"linearity was not judged: {error}",)
    parities: dict[str, Distortion] = {"even": found.even, "odd": found.odd}
    details = {
        parity: {"level": one.level, "p_value": one.p_value} for parity, one in parities.items()
    }
    notes = tuple(
        f"the response is not linear: {WHAT[parity]} shows at {parity} lines with "
        f"{100.0 * one.level:.1f} % of the tones (p = {one.p_value:.2g})"
        for parity, one in parities.items()
        if one.p_value < SURE and one.level > LARGE
    )
    return details, notes


def stretches_of(trial: Trial) -> Iterator[FloatArray]:
    """Yield the friction force of each steady sweep of which no sample is missing, N."""
    motion = smooth(trial.position_mm, trial.position_t_s)
    rate_hz = trial.info.sample_rate_hz
    for sweep in find_sweeps(motion, np.ones(motion.time_s.size, dtype=np.bool_)):
        first, last = max(round(sweep.begin_s * rate_hz), 0), round(sweep.end_s * rate_hz)
        stretch = sweep.direction * trial.force_n[first:last, 0]
        if np.all(np.isfinite(stretch)):
            yield stretch
