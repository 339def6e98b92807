"""Certificates and keys on disk: written once, keys for their owner alone."""

import datetime
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import NameOID

from frictus.files import read_bounded
from frictus_service.durable import blamed_on, put_in_free_place, unfinished_beside
from frictus_service.errors import (
    CertificateFileError,
    MemberNameError,
    WouldOverwriteError,
)
from frictus_service.security.authority import Issued
from frictus_service.security.members import Member

AUTHORITY: Final = "ca"
CERTIFICATE: Final = ".pem"
KEY: Final = ".key"
MAX_BYTES: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class Shown:
    """What a certificate says.

    Attributes
    ----------
    common_name : str
        Role and name, joined by a colon.
    member : Member or None
        None for an authority and for what is none of ours.
    authority : bool
        Whether it may sign others.
    issuer : str
        Common name of who signed it.
    hosts : tuple of str
        Under which a router is reached.
    begins, ends : datetime
        In UTC.
    """

    common_name: str
    member: Member | None
    authority: bool
    issuer: str
    hosts: tuple[str, ...]
    begins: datetime.datetime
    ends: datetime.datetime

    def state(self, now: datetime.datetime) -> str:
        """Return `valid`, `expired` or `not yet valid`."""
        if now < self.begins:
            return "not yet valid"
        return "valid" if now < self.ends else "expired"


def write(issued: Issued, folder: Path, stem: str) -> tuple[Path, Path]:
    """Write a certificate and its key; return their paths.

    Parameters
    ----------
    issued : Issued
        Certificate and key.
    folder : Path
        Made if it is missing.
    stem : str
        Name of both files, without suffix.

    Raises
    ------
    WouldOverwriteError
        If one of them exists; then neither is written.
    OSError
        If the disk refuses; then neither stays.
    """
    certificate, key = folder / f"{stem}{CERTIFICATE}", folder / f"{stem}{KEY}"
    for path in (certificate, key):
        if path.exists():
            raise WouldOverwriteError(
                f"{path} exists: move it away first, or choose another name or folder"
            )
    folder.mkdir(parents=True, exist_ok=True)
    _write_new(key, issued.key_pem, 0o600)
    try:
        _write_new(certificate, issued.certificate_pem, 0o644)
    except BaseException:
        key.unlink()
        raise
    return certificate, key


def _write_new(path: Path, content: bytes, mode: int) -> None:
    unfinished = unfinished_beside(path)
    try:
        with blamed_on(path):
            # With its permissions from the start: nobody else can ever read a key.
            descriptor = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
            with os.fdopen(descriptor, "wb") as file:
                file.write(content)
            put_in_free_place(unfinished, path)
    except FileExistsError as error:
        raise WouldOverwriteError(f"{path} exists: somebody was faster") from error
    finally:
        unfinished.unlink(missing_ok=True)


def read_authority(folder: Path) -> Issued:
    """Return the authority whose certificate and key stand in a folder.

    Raises
    ------
    CertificateFileError
        If they do not.
    """
    certificate_file, key_file = (
        folder / f"{AUTHORITY}{CERTIFICATE}",
        folder / f"{AUTHORITY}{KEY}",
    )
    certificate, pem = _certificate(certificate_file), _content(key_file)
    try:
        key = load_pem_private_key(pem, password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise CertificateFileError(
            f"{key_file}: no unencrypted private key: {error}"
        ) from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise CertificateFileError(f"{key_file}: not a key that `frictus pki create` makes")
    if key.public_key() != certificate.public_key():
        raise CertificateFileError(f"{key_file} is not the key of {certificate_file}")
    return Issued(certificate, key)


def show(path: Path) -> Shown:
    """Return what the certificate in a file says.

    Raises
    ------
    CertificateFileError
        If there is none in it.
    """
    certificate = _certificate(path)
    common_name = _common_name(certificate.subject)
    try:
        signs = certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    except x509.ExtensionNotFound:
        signs = False
    try:
        member = Member.of(common_name)
    except MemberNameError:
        member = None
    return Shown(
        common_name=common_name,
        member=member,
        authority=signs,
        issuer=_common_name(certificate.issuer),
        hosts=_hosts(certificate) if member is not None and member.role == "router" else (),
        begins=certificate.not_valid_before_utc,
        ends=certificate.not_valid_after_utc,
    )


def members_in(folder: Path) -> list[Member]:
    """Return the members whose certificates stand in a folder; an authority's is passed over.

    Raises
    ------
    CertificateFileError
        If it is no folder, or one of its certificates is none of ours.
    """
    if not folder.is_dir():
        raise CertificateFileError(
            f"{folder}: no folder; the certificates (not the keys) of all who may connect "
            "belong into it"
        )
    members = []
    for path in sorted(folder.glob(f"*{CERTIFICATE}")):
        shown = show(path)
        if shown.member is not None:
            members.append(shown.member)
        elif not shown.authority:
            raise CertificateFileError(
                f"{path}: common name {shown.common_name!r} is no ROLE:NAME; only certificates "
                "made by `frictus pki issue` belong into this folder"
            )
    return members


def _content(path: Path) -> bytes:
    try:
        return read_bounded(path, MAX_BYTES)
    except OSError as error:
        raise CertificateFileError(f"{path}: cannot be read: {error.strerror}") from error


def _certificate(path: Path) -> x509.Certificate:
    content = _content(path)
    try:
        return x509.load_pem_x509_certificate(content)
    except ValueError as error:
        raise CertificateFileError(f"{path}: no certificate (PEM): {error}") from error


def _common_name(name: x509.Name) -> str:
    found = name.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(found[0].value) if found else ""


def _hosts(certificate: x509.Certificate) -> tuple[str, ...]:
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    except x509.ExtensionNotFound:
        return ()
    return tuple(str(name.value) for name in names.value)


def guarded(key: Path) -> str:
    """Return what keeps others from reading a private key, or what the user must do for it."""
    if os.name == "posix":
        return "for its owner alone (mode 0600)"
    return (
        "which Windows lets others read as the folder does; in a shell of its owner: "
        f'icacls "{key}" /inheritance:r /grant:r "%USERNAME%:R"'
    )
