"""What of a study is used, what is not, and why."""

from collections import Counter
from collections.abc import Sequence

from frictus_service.identification.documents import (
    Excluded,
    StudySummary,
    TrialCount,
    TrialNote,
)
from frictus_service.identification.fit.conditions import ObservationTable
from frictus_service.identification.observation.observations import TrialObservations
from frictus_service.study.errors import Exclusion

NO_ROWS = "no response at its tones could be measured"


def account_for(
    observations: Sequence[TrialObservations],
    table: ObservationTable,
    path: str,
    sha256: str,
    unreadable: Sequence[Exclusion],
) -> StudySummary:
    """Return what is used of a study; a trial without a drive is counted, not excluded.

    Parameters
    ----------
    observations : sequence of TrialObservations
        Of all trials.
    table : ObservationTable
        What is used.
    path, sha256 : str
        Of the study.
    unreadable : sequence of Exclusion
        Trials of which there are no observations.
    """
    excluded = [
        Excluded(trial=item.trial, reasons=(f"{item.field}: {item.reason}",))
        for item in unreadable
    ]
    excluded += [
        Excluded(
            trial=item.info.id,
            participant=item.info.participant,
            speed_mm_s=item.info.speed_mm_s,
            force_n=item.info.force_n,
            tones_hz=item.info.tones_hz,
            reasons=item.reasons or (NO_ROWS,),
        )
        for item in observations
        if not item.valid or (item.info.tones_hz and not item.rows.tone_hz.size)
    ]
    return StudySummary(
        path=path,
        sha256=sha256,
        participants=len({item.info.participant for item in observations}),
        trials=len(observations) + len(unreadable),
        trials_used=len(table.trials),
        counts=_counts(observations, table),
        excluded=tuple(excluded),
        notes=tuple(
            TrialNote(trial=item.info.id, notes=item.notes)
            for item in table.trials
            if item.notes
        ),
    )


def _counts(
    observations: Sequence[TrialObservations], table: ObservationTable
) -> tuple[TrialCount, ...]:
    every = Counter(item.info.participant for item in observations)
    used = Counter(item.info.participant for item in table.trials)
    blank = Counter(item.info.participant for item in observations if not item.info.tones_hz)
    return tuple(
        TrialCount(
            participant=name, trials=every[name], used=used[name], without_drive=blank[name]
        )
        for name in sorted(every)
    )
