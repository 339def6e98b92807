"""What every study offers, whatever layout it is stored in."""

from collections.abc import Iterator
from typing import Protocol, Self

from frictus_service.study.digest import copy_of, measured_digest
from frictus_service.study.errors import Exclusion, TrialError
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo


class Study(Protocol):
    """An open study; a context manager."""

    @property
    def info(self) -> StudyInfo:
        """What holds for all trials."""

    @property
    def trials(self) -> tuple[TrialInfo, ...]:
        """Trials that can be read, by participant, session and order."""

    @property
    def excluded(self) -> tuple[Exclusion, ...]:
        """Trials that cannot be used, known without reading their data."""

    @property
    def sha256(self) -> str:
        """Hash of the whole study, hexadecimal."""

    def n_samples(self, trial_id: str) -> int:
        """Return how many samples a trial of `trials` has, without reading them."""

    def read(self, trial_id: str) -> Trial:
        """Return one trial.

        Raises
        ------
        TrialError
            If its data cannot be used.
        """

    def __enter__(self) -> Self:
        """Return the study."""

    def __exit__(self, *_: object) -> None:
        """Close it."""


def read_all(study: Study) -> Iterator[Trial | Exclusion]:
    """Yield every trial in order, one in memory at a time; what cannot be used as exclusions.

    Parameters
    ----------
    study : Study

    Yields
    ------
    Trial or Exclusion
        First those of `study.excluded`; a trial that holds the same data as an
        earlier one is excluded.
    """
    yield from study.excluded
    kept: dict[str, str] = {}
    for info in study.trials:
        try:
            trial = study.read(info.id)
        except TrialError as error:
            yield error.exclusion
            continue
        first = kept.setdefault(measured_digest(trial), info.id)
        yield trial if first == info.id else copy_of(first, info.id)
