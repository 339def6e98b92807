"""The checks of `frictus doctor`: what was found, and what to do about it."""

from collections.abc import Iterator
from pathlib import Path

from frictus_service.cli.checks.check import Check
from frictus_service.cli.checks.machine import (
    clock_resolution,
    clock_synchronised,
    disk_rate,
    real_time_priority,
    timer_lateness,
)
from frictus_service.cli.checks.service import (
    compiler_cache,
    configuration,
    device_checks,
    library_folder,
    packages,
    python_version,
    rig_files,
    router_and_rigs,
)
from frictus_service.config import Config

__all__ = [
    "Check",
    "all_checks",
    "clock_resolution",
    "clock_synchronised",
    "compiler_cache",
    "configuration",
    "device_checks",
    "disk_rate",
    "library_folder",
    "packages",
    "python_version",
    "real_time_priority",
    "rig_files",
    "router_and_rigs",
    "timer_lateness",
]


def all_checks(config_file: Path | None, router: str | None) -> Iterator[Check]:
    """Make every check, one after another."""
    yield python_version()
    yield packages()
    yield compiler_cache()
    config, found = configuration(config_file)
    yield found
    settings = config or Config()
    if config is not None:
        yield from rig_files(config)
        yield library_folder(config.textures)
        yield from device_checks(config.backend)
        yield disk_rate(config.recordings, config.sample_rate_hz)
    yield from router_and_rigs(router or settings.router.endpoint, settings.security)
    yield clock_resolution()
    yield timer_lateness()
    yield real_time_priority()
    yield clock_synchronised()
