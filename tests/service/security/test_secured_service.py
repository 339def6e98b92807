"""`[security]` in the configuration, and the whole service with it."""

from pathlib import Path

import pytest
from tests.patience import PATIENT, PATIENT_LEASE_MS

import frictus
import frictus.errors
from frictus.keys import Topics
from frictus_service.api.server import build_app
from frictus_service.config import Config, RegistryConfig, RouterConfig, SecurityConfig
from frictus_service.config_file import load, parse
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.errors import ConfigurationError
from frictus_service.processes import free_endpoint
from frictus_service.security.members import tls_of_rig
from frictus_service.security.router import open_secured_router

from .conftest import WAIT_S, Authority

TOML = """
[router]
endpoint = "tls/127.0.0.1:7447"
[security]
authority = "pki/ca.pem"
client = "pki/controller-alice.pem"
"""


@pytest.fixture
def security(tmp_path: Path) -> SecurityConfig:
    authority = Authority(tmp_path)
    return SecurityConfig(
        authority=authority.file,
        router=authority.sign("router:hall", ["127.0.0.1"]).certificate,
        members=tmp_path,
        rig=authority.sign("rig:lab/rig1").certificate,
        client=authority.sign("controller:alice").certificate,
    )


def secured(security: SecurityConfig, folder: Path) -> Config:
    return Config(
        router=RouterConfig(endpoint=free_endpoint().replace("tcp/", "tls/")),
        security=security,
        recordings=folder / "recordings",
        registry=RegistryConfig(url=f"sqlite:///{(folder / 'frictus.db').as_posix()}"),
        limits=PATIENT,
    )


def test_files_are_relative_to_the_configuration(tmp_path: Path) -> None:
    file = tmp_path / "frictus.toml"
    file.write_text(TOML)
    tls = load(file).tls("client")
    assert tls is not None
    assert tls.authority == tmp_path / "pki" / "ca.pem"
    assert tls.key == tmp_path / "pki" / "controller-alice.key"


def test_without_the_section_there_are_no_certificates() -> None:
    assert Config().tls("rig") is None


@pytest.mark.parametrize("drop", ["[security]", "[router]"])
def test_encryption_and_certificates_go_together(drop: str) -> None:
    text = TOML.split("[security]")[0] if drop == "[security]" else TOML.split('7447"')[1]
    with pytest.raises(ConfigurationError, match=r"goes with a \[security\] section"):
        parse(text, Path("frictus.toml"))


@pytest.mark.parametrize("torn", ["controller-alice.pem", "controller-alice.key", "ca.pem"])
def test_an_api_does_not_start_with_a_torn_certificate(
    security: SecurityConfig, tmp_path: Path, torn: str
) -> None:
    file = tmp_path / torn
    file.write_bytes(file.read_bytes()[:41])
    with pytest.raises(frictus.errors.CertificateError, match=r"controller-alice\.pem"):
        build_app(secured(security, tmp_path))


@pytest.mark.parametrize("who", ["rig", "router"])
def test_a_certificate_that_is_not_configured_is_named(who: str) -> None:
    config = parse(TOML, Path("frictus.toml"))
    with pytest.raises(ConfigurationError, match=rf"security\.{who}: .*frictus pki issue"):
        config.tls(who)  # type: ignore[arg-type]


def test_a_router_with_certificates_needs_its_members() -> None:
    with pytest.raises(ConfigurationError, match=r"security\.members"):
        open_secured_router(parse(TOML, Path("frictus.toml")))


def test_a_rig_needs_a_certificate_of_its_own(security: SecurityConfig, tmp_path: Path) -> None:
    config = secured(security, tmp_path)
    assert tls_of_rig(config) == config.tls("rig")
    other = config.model_copy(update={"rig": "rig2"})
    with pytest.raises(ConfigurationError, match=r"'rig:lab/rig1'.*pki issue rig lab/rig2"):
        tls_of_rig(other)


def test_rig_and_recorder_serve_a_controller(security: SecurityConfig, tmp_path: Path) -> None:
    config = secured(security, tmp_path)
    with Supervisor(config, ("rig", "recorder"), say=lambda _line: None) as supervisor:
        supervisor.wait_ready()
        with frictus.connect(config.router.endpoint, tls=security.of("client")) as client:
            rig = client.rig("rig1")
            assert not rig.recording().recording
            assert rig.record("pilot").recording
            with rig.arm(PATIENT_LEASE_MS), rig.open_stream(peak_n=0.05) as stream:
                stream.send([0.0, 0.04, 0.0, -0.04], period_mm=8.0, ttl_ms=5_000)
                statuses = rig.watch(Topics.STATUS, timeout_s=WAIT_S)
                assert any(
                    isinstance(status, frictus.RigStatus) and status.counters.stream_updates
                    for status in statuses
                )
                with rig.blocks("force", timeout_s=WAIT_S) as blocks:
                    next(blocks)
            assert rig.end_recording().blocks > 0
