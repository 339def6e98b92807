"""What one trial says about the model, read from its samples by whatever process has it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Self

from frictus_service.discovery.evidence.broadband import broadband
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
        "frictus_service.discovery.evidence.trial_evidence",
        "frictus_service.discovery.evidence.spectra",
        "frictus_service.discovery.evidence.sweep_speed",
        "frictus_service.discovery.evidence.window_spectra",
        "frictus_service.discovery.projection",
        "frictus_service.identification.observation.through_mount",
        "frictus_service.identification.observation.touch_path",
        "frictus_service.identification.plausibility.trial_statistics",
        "frictus_service.identification.plausibility.turns",
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
