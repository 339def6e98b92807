"""What goes wrong with recordings."""

from pathlib import Path

from frictus_service.errors import ServiceError


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
