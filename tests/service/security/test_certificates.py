"""Certificates as made and as read again; who may read the files."""

import datetime
import os
import stat
from pathlib import Path

import pytest
from cryptography import x509
from tests.full_disk import full_after

from frictus_service.errors import (
    CertificateFileError,
    MemberNameError,
    SecurityError,
    WouldOverwriteError,
)
from frictus_service.security.authority import issue, make_authority
from frictus_service.security.files import members_in, read_authority, show, write
from frictus_service.security.members import ROLES, Member, Role

from .conftest import DAY, Authority

NOW = datetime.datetime(2030, 1, 1, tzinfo=datetime.UTC)
NAMES = {"router": "hall", "rig": "lab/rig1", "controller": "alice", "observer": "bob"}


@pytest.mark.parametrize("role", ROLES)
def test_a_certificate_says_whose_it_is(role: Role, tmp_path: Path) -> None:
    authority = make_authority("our lab", NOW, 10 * DAY)
    hosts = ["10.0.0.7", "hall.example"] if role == "router" else []
    member = Member(role, NAMES[role])
    made = issue(authority, member, hosts, NOW, DAY)
    made.certificate.verify_directly_issued_by(authority.certificate)
    shown = show(write(made, tmp_path, "any")[0])
    assert (shown.member, shown.issuer, shown.authority) == (member, "our lab", False)
    assert shown.hosts == tuple(hosts)
    assert Member.of(shown.common_name) == member
    assert [shown.state(NOW + days * DAY) for days in (-1, 0, 2)] == [
        "not yet valid",
        "valid",
        "expired",
    ]


def test_a_certificate_does_not_outlast_its_authority() -> None:
    authority = make_authority("lab", NOW, 10 * DAY)
    made = issue(authority, Member("observer", "bob"), [], NOW + 9 * DAY, 5 * DAY)
    ends = authority.certificate.not_valid_after_utc
    assert made.certificate.not_valid_after_utc == ends


def test_only_an_authority_can_sign() -> None:
    authority = make_authority("lab", NOW, DAY)
    made = issue(authority, Member("observer", "bob"), [], NOW, DAY)
    for issued, signs in ((authority, True), (made, False)):
        constraints = issued.certificate.extensions.get_extension_for_class(
            x509.BasicConstraints
        )
        assert constraints.critical
        assert constraints.value.ca is signs


@pytest.mark.parametrize(
    ("role", "name"),
    [
        ("admin", "alice"),
        ("rig", "rig1"),
        ("rig", "lab/rig/1"),
        ("observer", "bob/x"),
        ("observer", ""),
        ("observer", "b*b"),
        ("observer", "b" * 60),
    ],
)
def test_a_name_that_no_certificate_can_bear(role: Role, name: str) -> None:
    with pytest.raises(MemberNameError):
        Member(role, name)


@pytest.mark.parametrize("host", ["10.0.0.7, hall", "a b", "tcp/hall", "hall:7447", "ü", ""])
def test_what_no_router_is_reached_under_is_no_host(host: str) -> None:
    authority = make_authority("test", NOW, DAY)
    with pytest.raises(MemberNameError, match="without a port"):
        issue(authority, Member("router", "x"), [host], NOW, DAY)


def test_an_authority_that_has_expired_issues_nothing() -> None:
    authority = make_authority("test", NOW - 2 * DAY, DAY)
    with pytest.raises(SecurityError, match="expired on"):
        issue(authority, Member("observer", "x"), [], NOW, DAY)


@pytest.mark.parametrize(("role", "hosts"), [("router", []), ("observer", ["10.0.0.7"])])
def test_a_router_and_only_a_router_has_hosts(role: Role, hosts: list[str]) -> None:
    authority = make_authority("lab", NOW, DAY)
    with pytest.raises(MemberNameError, match="--host"):
        issue(authority, Member(role, "x"), hosts, NOW, DAY)


@pytest.mark.skipif(os.name != "posix", reason="Windows keeps permissions otherwise")
def test_keys_are_for_their_owner_alone(tmp_path: Path) -> None:
    former = os.umask(0)
    try:
        authority = Authority(tmp_path)
        key = authority.sign("observer:bob").key
    finally:
        os.umask(former)
    for file in (key, tmp_path / "ca.key"):
        assert stat.S_IMODE(file.stat().st_mode) == 0o600


@pytest.mark.parametrize("suffix", [".pem", ".key"])
def test_nothing_is_overwritten(suffix: str, tmp_path: Path) -> None:
    made = make_authority("lab", NOW, DAY)
    there = tmp_path / f"ca{suffix}"
    there.write_text("precious")
    with pytest.raises(WouldOverwriteError, match=there.name):
        write(made, tmp_path, "ca")
    assert [path.name for path in tmp_path.iterdir()] == [there.name]
    assert there.read_text() == "precious"


@pytest.mark.parametrize("size", [0, 400])
def test_a_full_disk_leaves_neither_certificate_nor_key(size: int, tmp_path: Path) -> None:
    """It left an empty key, for which the next attempt was refused."""
    issued = make_authority("lab", NOW, DAY)
    with full_after(size), pytest.raises(OSError, match=r"too large.*ca"):
        write(issued, tmp_path, "ca")
    assert list(tmp_path.iterdir()) == []
    write(issued, tmp_path, "ca")


def test_an_authority_is_read_again(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    again = read_authority(tmp_path)
    assert again.certificate == authority.issued.certificate
    (tmp_path / "ca.key").write_bytes(authority.sign("observer:bob").key.read_bytes())
    with pytest.raises(CertificateFileError, match="is not the key of"):
        read_authority(tmp_path)


def test_members_are_those_whose_certificates_are_there(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    for name in ("rig:lab/rig1", "controller:alice", "observer:bob"):
        authority.sign(name)
    found = {member.common_name for member in members_in(tmp_path)}
    assert found == {"rig:lab/rig1", "controller:alice", "observer:bob"}
    (tmp_path / "observer-bob.pem").unlink()
    assert Member("observer", "bob") not in members_in(tmp_path)


def test_a_folder_with_something_else_in_it(tmp_path: Path) -> None:
    (tmp_path / "odd.pem").write_text("not a certificate")
    with pytest.raises(CertificateFileError, match=r"odd\.pem"):
        members_in(tmp_path)
    with pytest.raises(CertificateFileError, match="no folder"):
        members_in(tmp_path / "nowhere")
