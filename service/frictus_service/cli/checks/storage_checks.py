"""Whether what the service keeps has its place: folders, and the file of the registry."""

from collections.abc import Iterator
from pathlib import Path

from frictus_service.cli.checks.machine_checks import DoctorCheck
from frictus_service.config import Config
from frictus_service.durable import why_closed
from frictus_service.errors import RegistryUnavailableError


def folders(config: Config) -> Iterator[DoctorCheck]:
    """See whether the configured folders are some that can be written, or can be made.

    Parameters
    ----------
    config : Config
        Each key whose folder cannot be used is a check that fails.
    """
    for key in ("textures", "recordings", "studies"):
        folder: Path = getattr(config, key)
        if (why := why_closed(folder)) is not None:
            to_do = f"name another folder in `{key}`, or make this one usable"
            yield DoctorCheck("folders", "fail", f"{key}: {why}", to_do)


def registry(config: Config) -> Iterator[DoctorCheck]:
    """See whether a registry in a file can be one; it is neither made nor brought up to date.

    Parameters
    ----------
    config : Config
        With the URL of the registry.
    """
    from frictus_service.registry.database import Database  # half a second, not for `serve`

    try:
        Database(config.registry.url).require_file()
    except RegistryUnavailableError as error:
        yield DoctorCheck("registry", "fail", str(error), "correct `registry.url`")
