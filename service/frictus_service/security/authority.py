"""Making certificates: an authority, and what it signs for each member. Nothing is written."""

import datetime
import ipaddress
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from frictus_service.errors import MemberNameError, SecurityError
from frictus_service.security.members import Member

BACKDATED: Final = datetime.timedelta(minutes=5)
"""Clocks of a lab differ: a certificate is valid a little before it was made."""
_HOST: Final = re.compile(r"(\*\.)?[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")


@dataclass(frozen=True, slots=True)
class Issued:
    """A certificate and its private key.

    Attributes
    ----------
    certificate : Certificate
        Anybody may see it.
    key : EllipticCurvePrivateKey
        On the curve P-256. Nobody else may see it.
    """

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey

    @property
    def certificate_pem(self) -> bytes:
        """The certificate as text."""
        return self.certificate.public_bytes(Encoding.PEM)

    @property
    def key_pem(self) -> bytes:
        """The private key as text, not encrypted."""
        return self.key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def make_authority(name: str, begins: datetime.datetime, lasts: datetime.timedelta) -> Issued:
    """Return a new authority, which signs for itself.

    Parameters
    ----------
    name : str
        Its common name, 1 to 64 characters.
    begins : datetime
        Now, with time zone.
    lasts : timedelta
        How long it can be used.

    Raises
    ------
    MemberNameError
        If a certificate cannot bear the name.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    subject = _named(name)
    signing_only = x509.KeyUsage(
        digital_signature=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=True,
        encipher_only=False,
        decipher_only=False,
    )
    identifier = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
    certificate = (
        _begun(subject, subject, key, begins, lasts)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(signing_only, critical=True)
        .add_extension(identifier, critical=False)
        .sign(key, hashes.SHA256())
    )
    return Issued(certificate, key)


def issue(
    authority: Issued,
    member: Member,
    hosts: Sequence[str],
    begins: datetime.datetime,
    lasts: datetime.timedelta,
) -> Issued:
    """Return a new certificate for a member, signed by the authority.

    Parameters
    ----------
    authority : Issued
        Certificate and key of the authority.
    member : Member
        Role and name.
    hosts : sequence of str
        Addresses and names under which a router is reached; none for other roles.
    begins : datetime
        Now, with time zone.
    lasts : timedelta
        How long it can be used; it never outlasts the authority.

    Raises
    ------
    MemberNameError
        If a router has no hosts, or another role has some; or one that is no host.
    SecurityError
        If the authority has expired.
    """
    if member.role == "router" and not hosts:
        raise MemberNameError(
            f"router {member.name!r}: no hosts; accepted: every address and name under which "
            "it is reached, each with --host, such as --host 192.168.1.10"
        )
    if member.role != "router" and hosts:
        raise MemberNameError(
            f"{member.role} {member.name!r}: only a router has hosts; leave --host out"
        )
    key = ec.generate_private_key(ec.SECP256R1())
    ends = authority.certificate.not_valid_after_utc
    if ends <= begins:
        raise SecurityError(
            f"the authority's certificate expired on {ends:%Y-%m-%d}: make a new authority, "
            "and issue all certificates anew"
        )
    # A router is a server; the others are clients, and cannot pass for a router.
    usage = ExtendedKeyUsageOID.SERVER_AUTH if hosts else ExtendedKeyUsageOID.CLIENT_AUTH
    builder = (
        _begun(
            _named(member.common_name),
            authority.certificate.subject,
            key,
            begins,
            min(lasts, ends - begins),
        )
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([usage]), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(authority.key.public_key()),
            critical=False,
        )
    )
    # The TLS of Zenoh reads no certificate without alternative names.
    names = [_host(host) for host in hosts] or [x509.DNSName(f"{member.role}.invalid")]
    builder = builder.add_extension(x509.SubjectAlternativeName(names), critical=False)
    return Issued(builder.sign(authority.key, hashes.SHA256()), key)


def _begun(
    subject: x509.Name,
    issuer: x509.Name,
    key: ec.EllipticCurvePrivateKey,
    begins: datetime.datetime,
    lasts: datetime.timedelta,
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(begins - BACKDATED)
        .not_valid_after(begins + lasts)
    )


def _named(common_name: str) -> x509.Name:
    try:
        return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])
    except ValueError as error:
        raise MemberNameError(f"name {common_name!r}: 1 to 64 characters accepted") from error


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    # A certificate would bear anything in ASCII, and no router be reached under it.
    if not _HOST.fullmatch(host):
        raise MemberNameError(
            f"host {host!r}: an address, or a name of ASCII letters, digits, '-', '_' and '.', "
            "is accepted, without a port; repeat --host for each"
        )
    return x509.DNSName(host)
