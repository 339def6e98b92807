"""Certificates between the rig and NI's gRPC device server, real ones, on loopback."""

from collections.abc import Iterator
from pathlib import Path

import grpc
import numpy as np
import pytest
from tests.hardware.nidaq.bench import FingerTouch, conversion, loop_back, wiring
from tests.hardware.nidaq.fake_device import FakeDevice
from tests.hardware.nidaq.fake_server import FakeServer
from tests.service.security.conftest import DAY, Authority

from frictus_hardware.errors import ConfigError, HardwareError
from frictus_hardware.nidaq.assembly import reset
from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.nidaq.config import NiConfig, ServerTls
from frictus_hardware.simulated.config import SimulatedConfig


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    folder = tmp_path / "lab"
    folder.mkdir()
    return Authority(folder)


@pytest.fixture
def server(authority: Authority) -> Iterator[FakeServer]:
    own = authority.sign("router:rig-pc", ["127.0.0.1"])
    credentials = grpc.ssl_server_credentials(
        [(own.key.read_bytes(), own.certificate.read_bytes())],
        root_certificates=authority.file.read_bytes(),
        require_client_auth=True,
    )
    with FakeServer(FakeDevice(loop_back), credentials) as one:
        yield one


def encrypted(server: FakeServer, tls: ServerTls | None) -> NiConfig:
    return wiring(address=server.address, tls=tls, deadline_s=5.0)


def rig_of(config: NiConfig) -> NiRig:
    return NiRig(config, conversion(config), FingerTouch(SimulatedConfig()))


def test_a_rig_with_a_certificate_is_served(authority: Authority, server: FakeServer) -> None:
    ours = ServerTls(authority.file, authority.sign("rig:lab/rig1").certificate)
    with rig_of(encrypted(server, ours)) as rig:
        rig.exchange(np.zeros(100))
    reset(encrypted(server, ours))


def test_without_or_with_other_certificates_nothing_is_served(
    authority: Authority, server: FakeServer, tmp_path: Path
) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    stranger = Authority(elsewhere, "stranger")
    sound = authority.sign("rig:lab/rig1").certificate
    expired = authority.sign("rig:lab/rig2", age=2 * DAY, lasts=DAY).certificate
    refused = {
        "no encryption": None,
        "no certificate": ServerTls(authority.file),
        "another authority's": ServerTls(
            authority.file, stranger.sign("rig:lab/rig1").certificate
        ),
        "expired": ServerTls(authority.file, expired),
        "trusts another authority": ServerTls(stranger.file, sound),
    }
    for what, tls in refused.items():
        config = encrypted(server, tls)
        with pytest.raises(HardwareError, match="address = ") as raised:
            rig_of(config).open()
        assert raised.value.kind in ("config", "link_lost"), what
        with pytest.raises(HardwareError):
            reset(config)
    assert server.servicer.calls.total() == 0


def test_a_server_that_is_not_trusted_is_a_fault_of_the_configuration(
    authority: Authority, server: FakeServer, tmp_path: Path
) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    stranger = Authority(elsewhere, "stranger")
    sound = authority.sign("rig:lab/rig1").certificate
    config = encrypted(server, ServerTls(stranger.file, sound))
    with pytest.raises(ConfigError, match=r"certificate.*Compare authority"):
        rig_of(config).open()


def test_missing_files_are_named(server: FakeServer, tmp_path: Path) -> None:
    config = encrypted(server, ServerTls(tmp_path / "absent.pem"))
    with pytest.raises(ConfigError, match=r"absent\.pem cannot be read"):
        rig_of(config).open()


def test_certificates_without_a_server_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="give its address"):
        wiring(tls=ServerTls(tmp_path / "ca.pem"))
