"""How the command line ends: one clear sentence on standard error, and a stable exit code."""

import sys
from enum import IntEnum
from typing import Any

import typer
from typer.core import TyperGroup


class Exit(IntEnum):
    """Exit codes; programs may rely on them."""

    OK = 0
    UNEXPECTED = 1
    """Not foreseen, or a part of the service did not start."""
    USAGE = 2
    """An argument, or a file that one names, cannot be used."""
    CONFIG = 3
    NO_LINK = 4
    """No router, no rig or no registry answers."""
    REFUSED = 5
    """The rig refused, or took the lease away."""
    CHECK_FAILED = 6
    """A check failed, or measurements do not determine a model."""
    INTERRUPTED = 130


def code_of(error: Exception) -> Exit:
    """Return the exit code that stands for an error."""
    from frictus.errors import FrictusError, LinkError, NoRigError, RefusedError, SilenceError
    from frictus_service.calibration.errors import CalibrationError, EstimateError, FolderError
    from frictus_service.discovery.errors import BaseModelError, DesignError
    from frictus_service.discovery.mount.impact_test import ImpactRecordingError
    from frictus_service.discovery.mount.ring_down import RingDownError
    from frictus_service.errors import ConfigurationError
    from frictus_service.library import LibraryError
    from frictus_service.recording.errors import NotWrittenError, RecordingError
    from frictus_service.registry.errors import RegistryError, RegistryUnavailableError
    from frictus_service.security.errors import SecurityError
    from frictus_service.study.errors import StudyError

    if isinstance(error, ConfigurationError):
        return Exit.CONFIG
    if isinstance(error, LinkError | NoRigError | SilenceError | RegistryUnavailableError):
        return Exit.NO_LINK
    if isinstance(error, EstimateError | RingDownError):
        return Exit.CHECK_FAILED
    if isinstance(error, RefusedError | CalibrationError) and not isinstance(
        error, FolderError
    ):
        return Exit.REFUSED
    ours = (
        BaseModelError,
        ImpactRecordingError,
        DesignError,
        FolderError,
        FrictusError,
        LibraryError,
        RegistryError,
        RecordingError,
        SecurityError,
        StudyError,
    )
    files = (FileNotFoundError, IsADirectoryError, NotWrittenError)
    if isinstance(error, (*ours, *files)):
        return Exit.USAGE  # what is left of the client's errors is about what it was given
    return Exit.UNEXPECTED


def sentence_of(error: Exception) -> str:
    """Return what to tell the user about an error."""
    from frictus.errors import FrictusError
    from frictus_service.errors import ServiceError

    if isinstance(error, FrictusError | ServiceError | OSError):
        return str(error)
    return f"unexpected {type(error).__name__}: {error}; --debug shows where"


class CommandGroup(TyperGroup):
    """The commands; whatever goes wrong in one ends in a sentence and a code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise typer.Exit(Exit.INTERRUPTED) from None
        except BrokenPipeError:
            raise  # whoever read our output has enough; typer ends quietly
        except Exception as error:
            if type(error).__module__.startswith("typer") or ctx.params.get("debug"):
                raise
            sys.stderr.write(f"frictus: {sentence_of(error)}\n")
            raise typer.Exit(code_of(error)) from error
