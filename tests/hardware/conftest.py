"""A simulated device in a process of its own, for all tests of a run."""

import socket
from collections.abc import Iterator

import pytest
from tests.hardware.nidaq.stub_driver import StubDriver, installed

from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.device_rig import launched


@pytest.fixture(scope="session")
def device_address() -> Iterator[str]:
    """Address of a running device."""
    with launched(SimulatedConfig()) as device:
        yield device.address


@pytest.fixture
def unused_address() -> str:
    """An address where nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return "{}:{}".format(*probe.getsockname())


@pytest.fixture(scope="session")
def stub_driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StubDriver]:
    """A stub of NI's driver library where nidaqmx looks for the driver."""
    with installed(tmp_path_factory.mktemp("driver")) as driver:
        yield driver
