"""What a trial says about the model, and what a unit of trials says, as rows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Self

import numpy as np
from scipy import stats

from frictus_hardware.arrays import BoolArray, FloatArray, IntArray
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Probe
from frictus_service.discovery.evidence.broadband import broadband
from frictus_service.discovery.evidence.residuals import Compared, Layout, lay_out
from frictus_service.discovery.evidence.spectra import (
    NO_HARMONICS,
    NO_STRETCHES,
    HarmonicResponse,
    Stretches,
    spectra_of,
)
from frictus_service.identification.observation.observe import (
    FingerTrajectory,
    course_of,
    observe_along,
)
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.pipeline.study import STATISTICS, read_study
from frictus_service.identification.pipeline.workers import (
    Reader,
    Reading,
    columns_of,
    table_of,
)
from frictus_service.identification.plausibility.pool import TrialRecord
from frictus_service.identification.plausibility.trial_statistics import (
    TrialStatistics,
    statistics_of,
)
from frictus_service.study.trial import StudyInfo, Trial

NOTHING_READ: Final = {
    "harmonics": table_of(NO_HARMONICS),
    "stretches": table_of(NO_STRETCHES),
}
"""Of a trial that could not be read."""


@dataclass(frozen=True, slots=True)
class TrialEvidence:
    """Evidence of one trial.

    Attributes
    ----------
    observed : TrialObservations
        Responses, and whether the trial may be used.
    harmonics : HarmonicResponse
        One entry per row of `observed.rows`.
    stretches : Stretches
        One entry per third of a sweep, with or without drive.
    statistics : TrialStatistics or None
        By which its plausibility is judged; None of an unreadable trial.
    """

    observed: TrialObservations
    harmonics: HarmonicResponse
    stretches: Stretches
    statistics: TrialStatistics | None = None

    @classmethod
    def of(cls, reading: Reading) -> Self:
        """Return the evidence that workers or the cache give; empty of an unreadable trial."""
        more = reading.more or NOTHING_READ
        return cls(
            reading.observed,
            columns_of(HarmonicResponse, more["harmonics"]),
            columns_of(Stretches, more["stretches"]),
            TrialStatistics.of_table(more[STATISTICS]) if STATISTICS in more else None,
        )


def evidence_of(trial: Trial, study: StudyInfo) -> TrialEvidence:
    """Return the evidence of a trial; of one that names no tones, from its whole spectrum.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        Its mount, its carrier and its screen voltage are used.
    """
    course = course_of(trial)
    found = evidence_along(course, trial, study)
    return replace(found, statistics=statistics_of(trial, study, course))


def evidence_along(course: FingerTrajectory, trial: Trial, study: StudyInfo) -> TrialEvidence:
    """Return the evidence of a trial in the segments of a course; no statistics.

    Parameters
    ----------
    course : FingerTrajectory
        Of the finger in the trial; one row per segment and tone or band.
    trial : Trial
        As it was recorded.
    study : StudyInfo
        Its mount, its carrier and its screen voltage are used.
    """
    observed = observe_along(course, trial, study)
    harmonics, stretches = spectra_of(trial, study, course, observed.rows)
    if trial.info.tones_hz:
        return TrialEvidence(observed, harmonics, stretches)
    found = broadband(trial, study, course)
    notes = (*observed.notes, *found.notes)
    observed = replace(observed, rows=found.rows, notes=notes)
    return TrialEvidence(observed, found.harmonics, stretches)


def read_evidence(trial: Trial, study: StudyInfo) -> Reading:
    """Return the evidence of a trial as workers hand it on."""
    found = evidence_of(trial, study)
    more = {"harmonics": table_of(found.harmonics), "stretches": table_of(found.stretches)}
    if found.statistics is not None:
        more[STATISTICS] = found.statistics.as_table()
    return Reading(found.observed, more)


EVIDENCE: Final = Reader(
    "evidence",
    read_evidence,
    (
        "frictus_service.discovery.evidence.background",
        "frictus_service.discovery.evidence.bands",
        "frictus_service.discovery.evidence.broadband",
        "frictus_service.discovery.evidence.evidence_rows",
        "frictus_service.discovery.evidence.spectra",
        "frictus_service.identification.plausibility.trial_statistics",
    ),
)


def study_evidence(
    path: Path | str,
    *,
    workers: int | None = None,
    cache: Path | str | None = None,
    cluster: str | None = None,
    tell: Callable[[str], None] | None = None,
) -> list[TrialEvidence]:
    """Return the evidence of all trials of a study, in the order of its trials.

    Parameters
    ----------
    path : Path or str
        Of the file.
    workers, cache, cluster, tell
        As for `observe_study` of identification; the cache may be the same.

    Raises
    ------
    StudyError
        If the study cannot be read.
    WorkerError
        If worker processes do not start, or fail.
    ClusterError
        If the cluster cannot be used.
    """
    readings = read_study(
        path, EVIDENCE, workers=workers, cache=cache, cluster=cluster, tell=tell
    )
    return [TrialEvidence.of(reading) for reading in readings]


def judged(evidence: Sequence[TrialEvidence]) -> list[TrialRecord]:
    """Return what the plausibility of a study is judged by: of all trials that could be read.

    Parameters
    ----------
    evidence : sequence of TrialEvidence
        Of a whole study.
    """
    return [
        TrialRecord(one.observed, one.statistics)
        for one in evidence
        if one.statistics is not None
    ]


QUIET: Final = 0.1
"""Share of the trials that are quieter than that."""
WANDER: Final = 0.03
"""Standard deviation of a finger's speed within a row, as a share of its mean, about."""
LEAST_MM_S: Final = 0.02
"""Change of speed that is worth a thought."""


@dataclass(frozen=True, slots=True)
class EvidenceRows:
    """Rows of the whole study, sweeps of equal direction and third of a trial taken together.

    Arrays of shape (n_rows,), or (n_trials,) where the name says so.

    Attributes
    ----------
    unit_of_trial, condition_of_trial : ndarray of int
        Unit of each trial; number of its target speed and force.
    target_mm_s, target_n : ndarray
        Of each trial.
    trial, tone : ndarray of int
        Of each row; tones count from 0 in `tones_hz`.
    tones_hz : ndarray, shape (n_tones,)
    rows : Probe
        Where each row was measured.
    trials : Probe
        Where each trial was measured, on average; its tone means nothing.
    measured : Compared
        What was measured; NaN where nothing was.
    variance : ndarray
        Of ln size and of phase of each row, from the noise beside it.
    """

    unit_of_trial: IntArray
    condition_of_trial: IntArray
    target_mm_s: FloatArray
    target_n: FloatArray
    trial: IntArray
    tone: IntArray
    tones_hz: FloatArray
    rows: Probe
    trials: Probe
    measured: Compared
    variance: FloatArray


@dataclass(frozen=True, slots=True)
class Subject:
    """One unit's evidence.

    Attributes
    ----------
    rows, trials : Probe
        Where each was measured.
    tone : ndarray of int, shape (n_rows,)
    measured : Compared
        What was measured; NaN where nothing was.
    layout : Layout
        Which rows make which reading.
    quiet_n2 : float
        Power of its friction from 4 to 30 Hz in its quietest trials.
    condition : ndarray of int, shape (n_trials,)
        Numbers the target speeds and forces.
    target_mm_s, target_n : ndarray, shape (n_trials,)
    """

    rows: Probe
    trials: Probe
    tone: IntArray
    trial: IntArray
    measured: Compared
    layout: Layout
    quiet_n2: float
    condition: IntArray
    target_mm_s: FloatArray
    target_n: FloatArray


def subjects_of(rows: EvidenceRows, n_units: int) -> list[Subject]:
    """Return one subject per unit.

    Parameters
    ----------
    rows : EvidenceRows
        Of the whole study.
    n_units : int
        Participants, or blocks of their trials.
    """
    return [_subject(rows, unit) for unit in range(n_units)]


def _subject(study: EvidenceRows, unit: int) -> Subject:
    own_trials = np.flatnonzero(study.unit_of_trial == unit)
    place = np.full(study.unit_of_trial.size, -1)
    place[own_trials] = np.arange(own_trials.size)
    kept = np.flatnonzero(place[study.trial] >= 0)
    trial, tone = place[study.trial[kept]], study.tone[kept]
    measured = _part(study.measured, kept, own_trials)
    return Subject(
        rows=take(study.rows, kept),
        trials=take(study.trials, own_trials),
        tone=tone,
        trial=trial,
        measured=measured,
        layout=lay_out(trial, tone, measured),
        quiet_n2=_quiet(measured.low),
        condition=study.condition_of_trial[own_trials],
        target_mm_s=study.target_mm_s[own_trials],
        target_n=study.target_n[own_trials],
    )


def part_of(subject: Subject, trials: BoolArray) -> Subject:
    """Return a subject with some of its trials.

    Parameters
    ----------
    subject : Subject
        The evidence of one unit.
    trials : ndarray of bool, shape (n_trials,)
    """
    kept = np.flatnonzero(trials)
    place = np.full(trials.size, -1)
    place[kept] = np.arange(kept.size)
    rows = np.flatnonzero(place[subject.trial] >= 0)
    trial, tone = place[subject.trial[rows]], subject.tone[rows]
    measured = _part(subject.measured, rows, kept)
    return Subject(
        rows=take(subject.rows, rows),
        trials=take(subject.trials, kept),
        tone=tone,
        trial=trial,
        measured=measured,
        layout=lay_out(trial, tone, measured),
        quiet_n2=subject.quiet_n2,
        condition=subject.condition[kept],
        target_mm_s=subject.target_mm_s[kept],
        target_n=subject.target_n[kept],
    )


def _part(measured: Compared, rows: IntArray, trials: IntArray) -> Compared:
    return Compared(
        size=measured.size[rows],
        phase=measured.phase[rows],
        second=measured.second[rows],
        third=measured.third[rows],
        line50=measured.line50[trials],
        line60=measured.line60[trials],
        low=measured.low[trials],
    )


def take(probe: Probe, rows: IntArray) -> Probe:
    """Return some rows of a probe."""
    c = probe.circumstances
    return Probe(
        tone_hz=probe.tone_hz[rows],
        message=probe.message[rows],
        message_mean=probe.message_mean[rows],
        message_power=probe.message_power[rows],
        circumstances=SlidingConditions(
            speed_mm_s=c.speed_mm_s[rows],
            normal_force_n=c.normal_force_n[rows],
            position_mm=c.position_mm[rows],
            direction=c.direction[rows],
            minutes=c.minutes[rows],
        ),
        spread_hz=np.broadcast_to(probe.spread_hz, probe.tone_hz.shape)[rows],
    )


def _quiet(low: FloatArray) -> float:
    known = low[np.isfinite(low)]
    return float(np.exp(np.quantile(known, QUIET))) if known.size else 1.0


def within(subject: Subject, range_mm_s: tuple[float, float]) -> Subject:
    """Return a subject as if nothing followed its speed beyond a range.

    The speed wanders within a row: where its mean is near an end, it is beyond for a while.

    Parameters
    ----------
    subject : Subject
        The evidence of one unit.
    range_mm_s : tuple of float
        Lowest and highest speed.
    """
    low, high = range_mm_s
    circumstances = subject.rows.circumstances
    mean = circumstances.speed_mm_s
    spread = WANDER * mean
    inside = mean - _beyond(mean - high, spread) + _beyond(low - mean, spread)
    moved = np.abs(inside - mean) > LEAST_MM_S
    circumstances = replace(circumstances, speed_mm_s=np.where(moved, inside, mean))
    return replace(subject, rows=replace(subject.rows, circumstances=circumstances))


def as_asked(subject: Subject) -> Subject:
    """Return a subject whose finger moved and pressed just as it was asked to.

    Parameters
    ----------
    subject : Subject
        The evidence of one unit.
    """

    def moved(probe: Probe, trial: IntArray | slice) -> Probe:
        asked = replace(
            probe.circumstances,
            speed_mm_s=subject.target_mm_s[trial],
            normal_force_n=subject.target_n[trial],
        )
        return replace(probe, circumstances=asked)

    return replace(
        subject,
        rows=moved(subject.rows, subject.trial),
        trials=moved(subject.trials, slice(None)),
    )


def _beyond(mean: FloatArray, spread: FloatArray) -> FloatArray:
    """Return the mean of what is positive of a normal variable."""
    z = mean / spread
    found: FloatArray = mean * stats.norm.cdf(z) + spread * stats.norm.pdf(z)
    return found
