"""Options that several commands share, how a command answers, and how it ends."""

import errno
import getpass
import json
import os
import sys
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import typer
from typer.core import TyperGroup

if TYPE_CHECKING:
    import frictus
    from frictus_service.config import Config

HOW_TO_RESET: Final = (
    "It is reset on the dashboard, by `rig.reset()` in Python, or by POST /v1/rigs/RIG/reset."
)
"""No command does it: whoever resets is to have looked at what tripped the rig."""
_OTHER: Final = "name what this user may read, and a folder that it may write to"
_ROOM: Final = "make room there, or name another disk"
CLOSED: Final = {
    errno.EACCES: _OTHER,
    errno.EPERM: _OTHER,
    errno.EROFS: _OTHER,
    errno.ENOSPC: _ROOM,
    errno.EDQUOT: _ROOM,
}
"""What to do where a file or a folder refuses, by the number of the error."""


class Exit(IntEnum):
    """Exit codes; programs may rely on them."""

    OK = 0
    UNEXPECTED = 1
    """Not foreseen, or a part of the service did not start."""
    USAGE = 2
    """An argument, or a file that one names, cannot be used."""
    CONFIG = 3
    NO_LINK = 4
    """No router, rig, device or registry answers."""
    REFUSED = 5
    """The rig refused, or took the lease away."""
    CHECK_FAILED = 6
    """A check failed, or measurements do not determine a model."""
    INTERRUPTED = 130


def code_of(error: Exception) -> Exit:
    """Return the exit code that stands for an error."""
    from frictus.errors import FrictusError, LinkError, NoRigError, RefusedError, SilenceError
    from frictus_hardware.errors import ConfigError, DeviceLostError, LinkLostError
    from frictus_service.discovery.impact_recording import ImpactRecordingError
    from frictus_service.discovery.ring_down import RingDownError
    from frictus_service.errors import (
        BaseModelError,
        CalibrationError,
        ConfigurationError,
        DesignError,
        DraftCauseError,
        EstimateError,
        FolderError,
        NotWrittenError,
        RecordingError,
        RegistryError,
        RegistryUnavailableError,
        SecurityError,
        StudyError,
    )
    from frictus_service.library import LibraryError

    if isinstance(error, ConfigurationError | ConfigError):
        return Exit.CONFIG
    out_of_reach = (LinkError, NoRigError, SilenceError, RegistryUnavailableError)
    if isinstance(error, (*out_of_reach, DeviceLostError, LinkLostError)):
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
        DraftCauseError,
        FolderError,
        FrictusError,
        LibraryError,
        RegistryError,
        RecordingError,
        SecurityError,
        StudyError,
    )
    files = (FileNotFoundError, IsADirectoryError, NotWrittenError)
    if _is_of_a_file(error) or isinstance(error, (*ours, *files)):
        return Exit.USAGE  # what is left of the client's errors is about what it was given
    return Exit.UNEXPECTED


def _is_of_a_file(error: Exception) -> bool:
    refusals = {errno.ELOOP, *CLOSED}
    return isinstance(error, OSError) and bool(error.filename) and error.errno in refusals


def sentence_of(error: Exception) -> str:
    """Return what to tell the user about an error."""
    from frictus.errors import FrictusError, RefusedError
    from frictus_hardware.errors import HardwareError
    from frictus_service.errors import ServiceError

    if isinstance(error, FileNotFoundError) and _folder_is_gone():
        return "the folder in which this was started is there no more: change to another"
    if isinstance(error, FileNotFoundError) and error.filename is not None:
        return f"there is no file or folder {error.filename}"
    if isinstance(error, IsADirectoryError) and error.filename is not None:
        return f"{error.filename} is a folder; give a file"
    if isinstance(error, OSError) and _is_of_a_file(error):
        if error.errno == errno.ELOOP:
            return f"{error.filename}: a symbolic link that leads to itself"
        return f"{error.filename}: {error.strerror}; {CLOSED[error.errno or 0]}"
    if isinstance(error, RefusedError) and error.code == "tripped":
        return f"{error} {HOW_TO_RESET}"
    if isinstance(error, FrictusError | HardwareError | ServiceError | OSError):
        return str(error)
    return f"unexpected {type(error).__name__}: {error}; --debug shows where"


def _folder_is_gone() -> bool:
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def _reflow(group: TyperGroup) -> None:
    """Make each paragraph of a help one line: typer would keep the line ends of the source."""
    for command in group.commands.values():
        paragraphs = (command.help or "").split("\n\n")
        command.help = "\n\n".join(" ".join(each.split()) for each in paragraphs)
        if isinstance(command, TyperGroup):
            _reflow(command)


class CommandGroup(TyperGroup):
    """The commands; whatever goes wrong in one ends in a sentence and a code."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        _reflow(self)

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise typer.Exit(Exit.INTERRUPTED) from None
        except BrokenPipeError:
            raise  # whoever read our output has enough; typer ends quietly
        except Exception as error:
            from frictus.errors import printable

            if type(error).__module__.startswith("typer") or ctx.params.get("debug"):
                raise
            sys.stderr.write(f"frictus: {printable(sentence_of(error))}\n")
            raise typer.Exit(code_of(error)) from error


AsJson = Annotated[bool, typer.Option("--json", help="JSON, one object per line.")]
ConfigFile = Annotated[
    Path | None,
    typer.Option(
        "--config", "-c", metavar="FILE", help="Configuration.  [default: frictus.toml]"
    ),
]
RouterOption = Annotated[
    str | None,
    typer.Option("--router", metavar="ENDPOINT", help="Router.  [default: as configured]"),
]
SiteOption = Annotated[
    str | None, typer.Option("--site", help="Site of the rig.  [default: as configured]")
]
RigOption = Annotated[str | None, typer.Option("--rig", help="Rig.  [default: the only one]")]
Seconds = Annotated[
    float | None, typer.Option("--seconds", min=0.0, help="How long.  [default: until Ctrl-C]")
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", min=0, help="Processes.  [default: one per processor]"),
]
RandomSeed = Annotated[
    int | None, typer.Option("--seed", min=0, help="Of random draws.  [default: fresh]")
]
Response = Annotated[
    Literal["friction", "mobility"],
    typer.Option("--response", help="From drive to friction, or from friction to skin."),
]


@dataclass(frozen=True, slots=True)
class TargetRig:
    """Which rig a command is about: what the options say, else the configuration.

    Attributes
    ----------
    config : Config
        The configuration file's, or the defaults.
    router, site : str
        Endpoint of the router, and site.
    rig : str or None
        None: the only rig of the site.
    """

    config: "Config"
    router: str
    site: str
    rig: str | None

    @property
    def tls(self) -> "frictus.Tls | None":
        """What a command presents to the router."""
        return self.config.tls("client")

    @classmethod
    def of(
        cls, config: Path | None, router: str | None, site: str | None, rig: str | None
    ) -> "TargetRig":
        """Return the target of the given options.

        Raises
        ------
        ConfigurationError
            If the configuration file cannot be used.
        """
        from frictus_service.config_file import load

        loaded = load(config)
        return cls(loaded, router or loaded.router.endpoint, site or loaded.site, rig)

    def choose(self, client: "frictus.Client") -> "frictus.Rig":
        """Return the rig.

        Raises
        ------
        NoRigError
            If it is not present; or none was named, and none or several are present.
        """
        from frictus.errors import NoRigError

        if self.rig is not None:
            return client.rig(self.rig, self.site)
        present = [found.name for found in client.rigs(self.site)]
        if not present:
            return self._await(client)
        if len(present) > 1:
            raise NoRigError(
                f"site {self.site!r} has several rigs: {', '.join(present)}; "
                "name one with --rig"
            )
        return client.rig(present[0], self.site)

    def _await(self, client: "frictus.Client") -> "frictus.Rig":
        """Return the configured rig, which may be starting; else say how to name another."""
        from frictus.errors import NoRigError

        try:
            return client.rig(self.config.rig, self.site)
        except NoRigError as error:
            if not (elsewhere := client.rigs()):
                raise
            other = elsewhere[0]
            raise NoRigError(
                f"{error}; name it, as --site {other.site} --rig {other.name}"
            ) from error


def check_out(out: Path | None, *read: Path) -> None:
    """Refuse a file for a result before there is one that could not be written, or would harm.

    Parameters
    ----------
    out : Path or None
        As ``--out`` says.
    read : Path
        Files that the command reads; they need not be there.

    Raises
    ------
    ArgumentError
        If it is in no folder, is a folder, is what is read, or nothing may be written there.
    """
    from frictus.errors import ArgumentError
    from frictus_service.durable import why_closed

    if out is None:
        return
    if not out.parent.is_dir():
        raise ArgumentError(f"--out {out}: there is no folder {out.parent}")
    if out.is_dir():
        raise ArgumentError(f"--out {out}: that is a folder; give a file")
    if any(out.exists() and each.exists() and out.samefile(each) for each in read):
        raise ArgumentError(f"--out {out}: it is what is read, and would be lost; give another")
    direct = out.exists() and not out.is_file()  # a pipe or a device, of any folder
    if not direct and (why := why_closed(out.resolve().parent)) is not None:
        raise ArgumentError(f"--out {out}: {why}; give a file in another folder")


def check_out_folder(folder: Path, read: Path) -> None:
    """Refuse a folder for results before there are some that could not be written.

    Parameters
    ----------
    folder : Path
        As ``--out`` says, or where results go by themselves; it need not be there.
    read : Path
        What the command reads; where it is not there, the command is to say that.

    Raises
    ------
    ArgumentError
        If it is none, or nothing may be written there.
    """
    from frictus.errors import ArgumentError
    from frictus_service.durable import why_closed

    if os.path.exists(read) and (why := why_closed(folder)) is not None:
        raise ArgumentError(f"{folder}: {why}; name another folder by --out")


def write_out(out: Path, content: bytes) -> None:
    """Write a result, whole or not at all; a pipe or a device takes it as it comes.

    Parameters
    ----------
    out : Path
        As `check_out` accepts it; what stands there is replaced.
    content : bytes
        Of the file.

    Raises
    ------
    ArgumentError
        If its folder has gone since.
    """
    from frictus_service.durable import replace_file

    check_out(out)
    if out.exists() and not out.is_file():
        out.write_bytes(content)
    else:
        replace_file(out.resolve(), content)


def whoever_asks() -> str:
    """Return who runs the command, as the registry notes it."""
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):  # containers run as users whom they do not know
        return "unknown"


def wants_lines(as_json: bool) -> bool:
    """Return whether to write JSON lines: asked for, or nobody looks at a terminal."""
    return as_json or not sys.stdout.isatty()


def write_line(**fields: Any) -> None:
    """Write one object as one line, at once."""
    sys.stdout.write(json.dumps(fields, allow_nan=False) + "\n")
    sys.stdout.flush()
