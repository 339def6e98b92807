"""Every error the service raises on purpose; each is also the natural builtin."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

MAX_TOLD: Final = 120
"""Letters of a value that are repeated."""


class ServiceError(Exception):
    """Base of every error of this package."""


class ConfigurationError(ServiceError, ValueError):
    """The configuration file cannot be used; the text gives the file and the line at fault."""


class StartError(ServiceError, RuntimeError):
    """A part of the service did not start; the text says which and why."""


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


class AlignmentError(ServiceError, ValueError):
    """Strokes do not tell how the sensors lie; the text says what they lack and what to do."""


class ImplausibleStudyError(StudyError):
    """Every fit would be nonsense: a sign, a unit, an axis is wrong; the text says which."""


class NothingToIdentifyError(StudyError):
    """No trial of the study can be used; the text says why."""


class NoModelError(StudyError):
    """The identification gives no such model; the text says what it lacks."""


class ExcitationDesignError(ServiceError, ValueError):
    """An excitation cannot be built as asked; the text says which limit it meets."""


class PriorError(ServiceError, ValueError):
    """Earlier models say nothing that can be learned; the text names the model."""


class EstimateError(ServiceError, ValueError):
    """The trials do not determine the law; the text says what to measure."""


class ContradictionError(EstimateError):
    """No law fits the trials, or none that the prior admits."""


class CalibrationError(ServiceError, RuntimeError):
    """A calibration could not go on; the text says why, and what was kept."""


class CancelledError(CalibrationError):
    """Somebody ended the calibration; the finished trials are kept."""


class CaptureError(CalibrationError):
    """A trial came in too incomplete to be used; the text says which stream."""


class FolderError(CalibrationError, ValueError):
    """The folder holds another calibration, or something that is none."""


class UnknownCauseError(ServiceError, KeyError):
    """The catalogue has no cause of this id; the text lists those it has."""

    def __str__(self) -> str:
        """Return the text as it is: KeyError would put it in quotes."""
        return str(self.args[0])


class BaseModelError(ServiceError, ValueError):
    """There is no such base model, or it is not of the response that is asked for."""


class DraftCauseError(ServiceError, ValueError):
    """No cause of this name can be drafted, or nothing was characterised."""


class DesignError(ServiceError, ValueError):
    """There is no such design, or its trials cannot be planned with."""


class DiscoveryCancelledError(ServiceError, RuntimeError):
    """Somebody ended the discovery."""


class ExperimentCancelledError(ServiceError, RuntimeError):
    """Somebody ended the experiment; its answered trials are kept."""


class UnattendedError(ServiceError, TimeoutError):
    """Nobody answers an experiment any more; its answered trials are kept."""


class JobError(ServiceError):
    """Base of what is wrong with a request about discoveries or experiments."""


class UnknownStudyError(JobError, LookupError):
    """The folder of studies has no such file; the text lists some it has."""


class UnknownJobError(JobError, LookupError):
    """There is no job of this id."""


class UnknownDiscoveryError(UnknownJobError):
    """There is no discovery of this id."""


class UnknownExperimentError(UnknownJobError):
    """There is no experiment of this id."""


class JobStateError(JobError, RuntimeError):
    """The job is in a state that does not allow this; the text names it."""


class JobElsewhereError(JobStateError):
    """Another process runs the job."""


class TooManyJobsError(JobError, RuntimeError):
    """As many jobs wait for their turn as may."""


class RigInExperimentError(JobError, RuntimeError):
    """An experiment is under way on this rig."""


class RegistryError(ServiceError):
    """Base of every error of the registry."""


class RegistryNameError(RegistryError, ValueError):
    """A name, alias or reference that nothing in the registry can have."""


class ProvenanceError(RegistryError, ValueError):
    """A model does not say where it comes from, and is not published."""


class ComparisonError(RegistryError, ValueError):
    """Two models have no parameters in common."""


class UnknownModelError(RegistryError, LookupError):
    """There is no such model, version or alias."""


class UnknownCalibrationError(RegistryError, LookupError):
    """There is no such calibration."""


class AliasConflictError(RegistryError, RuntimeError):
    """The alias does not stand where the caller saw it."""


class KeyReusedError(RegistryError, ValueError):
    """An idempotency key came with a different request before."""


class CalibrationStateError(RegistryError, RuntimeError):
    """A calibration is in a state that does not allow this."""


class RigBusyError(RegistryError, RuntimeError):
    """A calibration is under way on this rig."""


class RegistryUnavailableError(RegistryError, ConnectionError):
    """The database cannot be reached or opened, or stayed locked."""


class RecordingError(ServiceError, ValueError):
    """The file is not a recording that can be used; the text says why, and what to do."""


class NotWrittenError(ServiceError, OSError):
    """The recording cannot be written: the name is taken, the disk full, the folder closed."""


class TornError(RecordingError):
    """What follows in the file cannot be trusted.

    Attributes
    ----------
    offset : int
        Byte at which the first record begins that is not whole.
    reason : str
        One sentence, for people.
    """

    def __init__(self, offset: int, reason: str) -> None:
        super().__init__(f"at byte {offset}: {reason}")
        self.offset = offset
        self.reason = reason


class ExportError(RecordingError):
    """The recording does not hold what a study needs."""


def unusable(path: Path, reason: str) -> RecordingError:
    """Return the error of a file that is no recording from its very beginning."""
    return RecordingError(f"{path}: {reason}")


def listed(names: Sequence[str], most: int) -> str:
    """Return names as a sentence has them: the first ones, and how many more there are.

    Parameters
    ----------
    names : sequence of str
        In the order in which they are told.
    most : int
        That are told.
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def as_told(value: object) -> str:
    """Return a value as a sentence repeats it: no more of it than a line.

    Parameters
    ----------
    value : object
        Of a file: an attribute holds 64 kB and more.
    """
    told = ascii(value) if isinstance(value, str) and not value.isprintable() else repr(value)
    return told if len(told) <= MAX_TOLD else f"{told[: MAX_TOLD - 3]}..."


class SecurityError(ServiceError):
    """Base of every error of this package."""


class MemberNameError(SecurityError, ValueError):
    """A role or name that no certificate can bear."""


class CertificateFileError(SecurityError, ValueError):
    """A file holds no certificate or key of ours; the text says which and why."""


class WouldOverwriteError(SecurityError, FileExistsError):
    """A certificate or key of that name is there already."""
