"""The API at a router, as often as a test wants it, and a rig that follows pages."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from tests.service.dashboard.page import configuration, serving

from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.guided import ClientFinger
from frictus_service.config import ApiConfig, Config, Limits, RouterConfig
from frictus_service.daemon.supervisor import Supervisor
from frictus_service.processes import free_endpoint

Serve = Callable[..., AbstractContextManager[int]]


@pytest.fixture
def serve(tmp_path: Path) -> Serve:
    """Run the API at a router."""

    def start(
        router: str, tokens: bool = False, origins: tuple[str, ...] = ()
    ) -> AbstractContextManager[int]:
        return serving(configuration(router, tmp_path, tokens, origins))

    return start


@pytest.fixture(scope="module")
def router() -> Iterator[str]:
    """A rig whose finger follows pages."""
    endpoint = free_endpoint()
    config = Config(
        backend=SimulatedConfig(finger=ClientFinger(smoothing_hz=50.0)),
        router=RouterConfig(endpoint=endpoint),
        api=ApiConfig(enabled=False),
        limits=Limits(freeze_ms=5_000, missed_deadlines=1_000),  # for busy machines
    )
    with Supervisor(config, ("rig",)) as supervisor:
        supervisor.wait_ready(100.0)
        yield endpoint


@pytest.fixture(scope="module")
def port(router: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The API beside it, with tokens."""
    with serving(configuration(router, tmp_path_factory.mktemp("api"), True)) as port:
        yield port
