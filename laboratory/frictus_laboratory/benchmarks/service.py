"""The service that is measured: supervisor, rig and API on this machine, at free ports."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import frictus
from frictus.keys import Topics
from frictus_hardware import BackendConfig, SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import ApiConfig, Config, Limits, RouterConfig
from frictus_service.daemon.child_process import PartName
from frictus_service.daemon.supervisor import Supervisor
from frictus_service.errors import StartError
from frictus_service.processes import free_endpoint, free_port

RIG: Final = "rig1"
QUIET_S: Final = 10.0
"""A rig that says nothing for so long is taken for dead."""
STEADY: Final = SimulatedConfig(finger=SteadyStrokes())


def config_of(backend: BackendConfig = STEADY, limits: Limits | None = None) -> Config:
    """Return the configuration of a service at free ports."""
    return Config(
        rig=RIG,
        backend=backend,
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=free_port()),
        limits=limits or Limits(),
    )


@contextmanager
def serving(config: Config, parts: Sequence[PartName] = ("rig",)) -> Iterator[Supervisor]:
    """Run the service; what it says is told only if it does not start.

    Raises
    ------
    StartError
        If it does not start.
    """
    said: list[str] = []
    with Supervisor(config, parts, say=said.append) as supervisor:
        try:
            supervisor.wait_ready(120.0)
        except StartError:
            sys.stderr.write("\n".join([*said, ""]))
            raise
        yield supervisor


def await_status(
    rig: frictus.Rig, holds: Callable[[frictus.RigStatus], bool], timeout_s: float = 60.0
) -> frictus.RigStatus:
    """Return the first status for which something holds, the present one included.

    Raises
    ------
    SilenceError
        If the rig says nothing for so long.
    """
    with rig.watch(Topics.STATUS, timeout_s=timeout_s) as states:
        return next(s for s in states if isinstance(s, frictus.RigStatus) and holds(s))
