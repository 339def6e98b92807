"""How one recording is cut: into trials that share no sample, windows in time, and folds.

A copy is no second measurement. Windows are parts of steady sweeps, each of which speaks for
itself; each fold is predicted from the others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import signal

from frictus_hardware.arrays import FloatArray, IntArray
from frictus_service.discovery.evidence.band_noise import entries_of
from frictus_service.discovery.evidence.bands import RANGE_HZ, WINDOW_S
from frictus_service.discovery.evidence.observation_table import (
    ResponseName,
    UnitAssignment,
    dealt,
)
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence, evidence_along
from frictus_service.identification.observation.observe import course_of
from frictus_service.identification.observation.sweeps import Sweep, SweepThird, TouchMotion
from frictus_service.study.trial import StudyInfo, Trial

SHORT_S: Final = 0.3
"""A window of a recording that has few: three windows of a spectrum side by side."""
LONG_S: Final = 1.0
"""And of one that has many: three periods of a tone of 3 Hz."""
MANY_S: Final = 20.0
"""Of steady movement in all, from which windows are long."""
MOST_FOLDS: Final = 10
LEAST_FOLDS: Final = 3
"""Two cannot say how much what they find scatters."""
TIMES: Final = 3.0
"""Correlation times between windows: what was random in one has fallen to a twentieth."""
LEAST_APART_S: Final = 0.02
RUN: Final = 16
"""Samples of the force that are compared at once: noise of two bits repeats none by chance."""
LEAST_LEVELS: Final = 4
"""Different values in a run; one that rests repeats itself."""
SHARED: Final = 0.01
"""Of the runs of a trial, from which it is taken to repeat another."""


def windows_of(
    trial: Trial, study: StudyInfo, length_s: float, apart_s: float
) -> list[TrialEvidence]:
    """Return the evidence of each window of a trial, in time; each as a trial of its own.

    Targets of speed and force are not asked: what was measured counts.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        Its mount, its carrier and its screen voltage are used.
    length_s : float
        Of a window, about.
    apart_s : float
        At least so long from the end of one to the beginning of the next.
    """
    course = course_of(trial)
    cut = [
        each
        for sweep in course.sweeps
        for each in _cut(course.motion, sweep, length_s, apart_s)
    ]
    segments = [replace(each, sweep=number) for number, each in enumerate(cut)]
    if not segments:
        return []
    whole = evidence_along(replace(course, segments=segments), trial, study)
    return [_window(whole, segment, trial) for segment in segments]


def _cut(
    motion: TouchMotion, sweep: Sweep, length_s: float, apart_s: float
) -> Iterator[SweepThird]:
    """Yield the windows of a sweep: as many as it holds, all of one length."""
    path, lasting = motion.within(sweep), sweep.end_s - sweep.begin_s
    count = max(1, int((lasting + apart_s) / (length_s + apart_s)))
    length = (lasting + apart_s) / count - apart_s
    for number in range(count):
        begin = sweep.begin_s + number * (length + apart_s)
        yield from SweepThird.between(path, sweep, begin, begin + length)


def _window(whole: TrialEvidence, segment: SweepThird, trial: Trial) -> TrialEvidence:
    """Return the part of a trial's evidence that one window gave, as if it were a trial."""
    info = trial.info
    rows, stretches = whole.observed.rows, whole.stretches
    own = rows.sweep == segment.sweep
    begins = datetime.fromisoformat(info.started_utc) + timedelta(seconds=segment.begin_s)
    observed = replace(
        whole.observed,
        info=replace(
            info,
            id=f"{info.id}, {segment.begin_s:.2f} to {segment.end_s:.2f} s",
            started_utc=begins.isoformat(),
        ),
        valid=True,
        reasons=(),
        rows=entries_of(rows, own),
    )
    return TrialEvidence(
        observed,
        entries_of(whole.harmonics, own),
        entries_of(stretches, stretches.sweep == segment.sweep),
    )


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


class SeenSamples:
    """The force of all trials so far, by which a copy or an overlap is noticed.

    Found wherever it begins, as long as no sample was changed: whole trials under another
    name, and windows cut from one recording so that they overlap.
    """

    def __init__(self) -> None:
        self._runs: dict[str, NDArray[np.uint64]] = {}

    def repeated(self, trial: Trial) -> str:
        """Return the sentence that refuses a trial, and remember it; empty where it is new.

        Parameters
        ----------
        trial : Trial
            As it was recorded.
        """
        runs = _runs(trial.force_n[:, 0])
        for name, before in self._runs.items():
            share = float(np.isin(runs, before).mean()) if runs.size else 0.0
            if share > SHARED:
                seconds = share * trial.force_n.shape[0] / trial.info.sample_rate_hz
                return (
                    f"trial {trial.info.id} holds {seconds:.2g} s of trial {name}, sample for "
                    "sample: it is no independent measurement and is not used; give each "
                    "recording once, in windows that do not overlap"
                )
        self._runs[trial.info.id] = np.unique(runs)
        return ""


def _runs(force_n: FloatArray) -> NDArray[np.uint64]:
    """Return a number for each run of samples that varies, equal for equal runs."""
    if force_n.size < RUN:
        return np.empty(0, dtype=np.uint64)
    bits: NDArray[np.uint64] = np.ascontiguousarray(force_n).view(np.uint64)
    changed = np.concatenate([[0], np.cumsum(bits[1:] != bits[:-1])])
    lively = changed[RUN - 1 :] - changed[: changed.size - RUN + 1] >= LEAST_LEVELS
    # Odd factors modulo 2^64: a polynomial hash, whose sums wrap around.
    factors = np.cumprod(np.full(RUN, 0x9E3779B97F4A7C15, dtype=np.uint64))
    mixed = bits ^ (bits >> np.uint64(29))
    hashed: NDArray[np.uint64] = (sliding_window_view(mixed, RUN) @ factors).astype(np.uint64)
    found: NDArray[np.uint64] = hashed[lively]
    return found
