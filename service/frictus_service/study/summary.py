"""What is in a study, in figures."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from frictus_service.errors import Exclusion
from frictus_service.study.importers import Study, read_all
from frictus_service.study.layout import NAMES
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo


@dataclass(frozen=True, slots=True)
class ParticipantSummary:
    """One participant's share of a study.

    Attributes
    ----------
    name : str
        Unique among its kind.
    sessions, trials, blanks : int
        Blanks are trials without a drive.
    duration_s : float
        Of all trials.
    """

    name: str
    sessions: int
    trials: int
    blanks: int
    duration_s: float


@dataclass(frozen=True, slots=True)
class StudyContents:
    """What is in a study.

    Attributes
    ----------
    info : StudyInfo
        What holds for all trials.
    size_bytes : int
        On disk.
    participants : tuple of ParticipantSummary
        One entry each.
    conditions : dict of str to dict of float to int
        By attribute: its values, rising, and in how many trials each occurs.
    excluded : tuple of Exclusion
        Trials that cannot be used.
    missing : dict of str to dict of str to int, or None
        Missing samples by trial and data set, where there are any; None: not looked for.
    """

    info: StudyInfo
    size_bytes: int
    participants: tuple[ParticipantSummary, ...]
    conditions: dict[str, dict[float, int]]
    excluded: tuple[Exclusion, ...]
    missing: dict[str, dict[str, int]] | None

    @property
    def n_trials(self) -> int:
        """How many trials can be used."""
        return sum(participant.trials for participant in self.participants)

    @property
    def duration_s(self) -> float:
        """Of all trials that can be used."""
        return sum(participant.duration_s for participant in self.participants)

    def fields(self) -> dict[str, Any]:
        """Return all of it as plain values, for JSON."""
        return {
            "rig": self.info.rig,
            "carrier_hz": self.info.carrier_hz,
            "screen_peak_v": self.info.screen_peak_v,
            "mount": self.info.mount is not None,
            "positions_late_s": self.info.positions_late_s,
            "extras": self.info.extras,
            "size_bytes": self.size_bytes,
            "trials": self.n_trials,
            "duration_s": self.duration_s,
            "participants": [asdict(participant) for participant in self.participants],
            "conditions": self.conditions,
            "excluded": [asdict(exclusion) for exclusion in self.excluded],
            "missing": self.missing,
        }


def summarise(study: Study, size_bytes: int, *, check: bool = False) -> StudyContents:
    """Return what is in a study.

    Parameters
    ----------
    study : Study
        Open.
    size_bytes : int
        On disk.
    check : bool
        Read all data: finds damage, copies and missing samples. Else attributes alone.
    """
    trials, excluded, missing = study.trials, study.excluded, None
    if check:
        trials, excluded, missing = _checked(study)
    return StudyContents(
        info=study.info,
        size_bytes=size_bytes,
        participants=_participants(study, trials),
        conditions={
            "speed_mm_s": _counted(trial.speed_mm_s for trial in trials),
            "force_n": _counted(trial.force_n for trial in trials),
            "tone_hz": _counted(tone for trial in trials for tone in trial.tones_hz or (0.0,)),
            "drive_vpp": _counted(trial.drive_vpp for trial in trials),
            "sample_rate_hz": _counted(trial.sample_rate_hz for trial in trials),
        },
        excluded=excluded,
        missing=missing,
    )


def missing_samples(trial: Trial) -> dict[str, int]:
    """Return how many rows of each data set miss a value; only those that do."""
    counts = {}
    for name in NAMES:
        values = getattr(trial, name)
        if values is not None:
            missing = np.isnan(values)
            rows = missing.any(axis=1) if missing.ndim > 1 else missing
            counts[name] = int(np.count_nonzero(rows))
    return {name: count for name, count in counts.items() if count}


def _checked(
    study: Study,
) -> tuple[tuple[TrialInfo, ...], tuple[Exclusion, ...], dict[str, dict[str, int]]]:
    """Read everything; return what can be used, what cannot, and missing samples."""
    trials: list[TrialInfo] = []
    excluded: list[Exclusion] = []
    missing: dict[str, dict[str, int]] = {}
    for found in read_all(study):
        if isinstance(found, Exclusion):
            excluded.append(found)
            continue
        trials.append(found.info)
        if counts := missing_samples(found):
            missing[found.info.id] = counts
    return tuple(trials), tuple(excluded), missing


def _participants(study: Study, trials: Iterable[TrialInfo]) -> tuple[ParticipantSummary, ...]:
    own: dict[str, list[TrialInfo]] = {}
    for trial in trials:
        own.setdefault(trial.participant, []).append(trial)
    return tuple(
        ParticipantSummary(
            name=name,
            sessions=len({trial.session for trial in done}),
            trials=len(done),
            blanks=sum(not (trial.tones_hz or trial.drive_vpp) for trial in done),
            duration_s=sum(study.n_samples(trial.id) / trial.sample_rate_hz for trial in done),
        )
        for name, done in own.items()
    )


def _counted(values: Iterable[float]) -> dict[float, int]:
    return dict(sorted(Counter(values).items()))
