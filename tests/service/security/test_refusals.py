"""Whom the router does not let in, and how it is said."""

import datetime
import json
import queue
from pathlib import Path

import pytest
import zenoh
from zenoh.handlers import Callback

import frictus
from frictus.keys import RigKeys
from frictus.session import open_router
from frictus.tls import Tls, why_refused
from frictus_service.processes import free_endpoint, free_port

from .conftest import WAIT_S, Authority, Lab

TRY_S = 0.5
AN_HOUR = datetime.timedelta(hours=1)


def refusal(endpoint: str, tls: Tls | None) -> str:
    with pytest.raises(frictus.LinkError) as refused:
        frictus.connect(endpoint, timeout_s=TRY_S, tls=tls)
    return str(refused.value)


def test_without_a_certificate_nothing_is_got(lab: Lab) -> None:
    config = zenoh.Config()
    for key, value in {
        "mode": "client",
        "connect/endpoints": [lab.endpoint],
        "connect/timeout_ms": int(1e3 * TRY_S),
        "scouting/multicast/enabled": False,
        "transport/link/tls": {"root_ca_certificate": str(lab.authority.file)},
    }.items():
        config.insert_json5(key, json.dumps(value))
    with pytest.raises(zenoh.ZError):
        zenoh.open(config)


def test_our_client_asks_for_certificates(lab: Lab) -> None:
    assert "tls" in refusal(lab.endpoint, None)
    assert "tcp, not tls" in refusal(lab.endpoint.replace("tls/", "tcp/"), None)


def test_certificates_are_not_presented_in_the_clear(lab: Lab) -> None:
    assert "tls/HOST:PORT" in refusal(lab.endpoint.replace("tls/", "tcp/"), lab.observer)


def test_a_router_of_another_authority(lab: Lab, tmp_path: Path) -> None:
    other = Authority(tmp_path).sign("observer:bob")
    assert "router's certificate: another authority signed it" in refusal(lab.endpoint, other)


@pytest.mark.parametrize("name", ["lab", "theirs"])
def test_a_certificate_of_another_authority(name: str, lab: Lab, tmp_path: Path) -> None:
    foreign = Authority(tmp_path / "foreign", name).sign("controller:eve")
    both = tmp_path / "both.pem"
    both.write_bytes(lab.authority.file.read_bytes() + foreign.authority.read_bytes())
    said = refusal(lab.endpoint, Tls(both, foreign.certificate))
    assert "(controller:eve): the router trusts another authority" in said
    assert "frictus pki issue" in said


def test_the_own_authority_did_not_sign_it(lab: Lab, tmp_path: Path) -> None:
    foreign = Authority(tmp_path).sign("controller:eve")
    said = refusal(lab.endpoint, Tls(lab.authority.file, foreign.certificate))
    assert str(foreign.certificate) in said
    assert "another authority signed it" in said


def test_an_expired_certificate(lab: Lab) -> None:
    expired = lab.authority.sign("observer:old", age=2 * AN_HOUR, lasts=AN_HOUR)
    said = refusal(lab.endpoint, expired)
    assert str(expired.certificate) in said
    assert "it has expired" in said
    assert "frictus pki issue" in said


def test_a_key_that_is_anothers(lab: Lab) -> None:
    swapped = lab.authority.sign("observer:swapped")
    swapped.key.write_bytes(lab.observer.key.read_bytes())
    assert "do not belong together" in refusal(lab.endpoint, swapped)


def test_a_file_that_is_missing(lab: Lab) -> None:
    nowhere = lab.authority.folder / "nowhere.pem"
    assert f"{nowhere}: cannot be read" in refusal(
        lab.endpoint, Tls(lab.authority.file, nowhere)
    )


def test_a_router_cannot_pass_for_a_client_nor_a_client_for_a_router(lab: Lab) -> None:
    router = lab.authority.sign("router:spare", ["127.0.0.1"])
    assert "router's" in refusal(lab.endpoint, router)
    with pytest.raises(frictus.CertificateError, match="no router's where one is due"):
        open_router(f"tls/127.0.0.1:{free_port()}", lab.controller)


def test_a_router_with_an_expired_certificate_does_not_start(lab: Lab) -> None:
    expired = lab.authority.sign("router:old", ["127.0.0.1"], age=2 * AN_HOUR, lasts=AN_HOUR)
    with pytest.raises(frictus.CertificateError, match="expired"):
        open_router(f"tls/127.0.0.1:{free_port()}", expired)


def test_a_router_under_a_name_that_it_does_not_bear(lab: Lab) -> None:
    elsewhere = lab.authority.sign("router:elsewhere", ["elsewhere.example"])
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with open_router(endpoint, elsewhere):
        assert "it is for another host" in refusal(endpoint, lab.observer)


def test_nothing_is_said_of_certificates_where_nobody_listens(lab: Lab) -> None:
    endpoint = f"tls/127.0.0.1:{free_port()}"
    assert why_refused(endpoint, lab.observer, TRY_S) == ""
    assert "no router answers" in refusal(endpoint, lab.observer)


def test_a_router_without_certificates_is_named_as_such(lab: Lab) -> None:
    plain = free_endpoint()
    with open_router(plain):
        said = refusal(plain.replace("tcp/", "tls/"), lab.observer)
    assert "no router answers" in said or "no TLS" in said


def test_a_link_ends_when_its_certificate_expires(lab: Lab) -> None:
    router = lab.authority.sign("router:strict", ["127.0.0.1"])
    endpoint = f"tls/127.0.0.1:{free_port()}"
    tokens: queue.Queue[zenoh.SampleKind] = queue.Queue()

    def note(sample: zenoh.Sample) -> None:
        tokens.put(sample.kind)

    key = RigKeys("lab", "brief").alive
    with open_router(endpoint, router) as hub:
        watch = hub.liveliness().declare_subscriber(key, Callback(note), history=True)
        brief = lab.authority.sign("rig:lab/brief", lasts=datetime.timedelta(seconds=5))
        with frictus.connect(endpoint, tls=brief) as client:
            token = client.session.liveliness().declare_token(key)
            assert tokens.get(timeout=WAIT_S) == zenoh.SampleKind.PUT
            assert tokens.get(timeout=WAIT_S) == zenoh.SampleKind.DELETE
            token.undeclare()  # type: ignore[no-untyped-call]
        watch.undeclare()  # type: ignore[no-untyped-call]
