"""Windows in time of a trial: parts of its steady sweeps, each of which speaks for itself."""

from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Final

from frictus_service.discovery.evidence.band_noise import entries_of
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
