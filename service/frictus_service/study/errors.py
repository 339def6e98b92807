"""What is refused of a study, and what is left out of one."""

from dataclasses import dataclass
from pathlib import Path

from frictus_service.errors import ServiceError


class StudyError(ServiceError, ValueError):
    """The study cannot be used; the text names the file, the field and what is accepted."""


class FieldError(StudyError):
    """One attribute or data set cannot be used.

    Attributes
    ----------
    field : str
        Its name.
    reason : str
        What is wrong, what is accepted, what to do.
    """

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(f"{field}: {reason}")
        self.field = field
        self.reason = reason


@dataclass(frozen=True, slots=True)
class Exclusion:
    """A trial that is left out of a study, and why.

    Attributes
    ----------
    trial : str
        Its id.
    field : str
        The attribute or data set at fault.
    reason : str
        One sentence, for people.
    """

    trial: str
    field: str
    reason: str


class TrialError(StudyError):
    """One trial cannot be used; the rest of the study can.

    Attributes
    ----------
    exclusion : Exclusion
        Which trial, field and reason.
    """

    def __init__(self, path: Path, exclusion: Exclusion) -> None:
        super().__init__(
            f"{path}, trial {exclusion.trial}, {exclusion.field}: {exclusion.reason}"
        )
        self.path = path
        self.exclusion = exclusion

    def __reduce__(self) -> tuple[type["TrialError"], tuple[Path, Exclusion]]:
        """Travel from a worker process whole."""
        return (TrialError, (self.path, self.exclusion))
