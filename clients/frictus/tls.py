"""Who we are to a router that asks for certificates, and why a connection was refused.

Zenoh says only that it could not connect. What was wrong with which certificate comes from a
handshake of our own, made after a failure and never otherwise.
"""

import socket
import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from frictus.errors import CertificateError

SCHEME: Final = "tls/"
_AFTER_HANDSHAKE_S: Final = 1.0
"""A router judges our certificate once our side of the handshake is done."""
_WORDS: Final = {
    "certificate required": "the router asks for a client certificate",
    "unknown ca": "the router trusts another authority",
    "alert decrypt error": "the router trusts another authority, of the same name",
    "certificate expired": "the router says that our certificate has expired",
    "certificate has expired": "it has expired",
    "not yet valid": "it is not valid yet: compare the clocks",
    "unable to get local issuer": "another authority signed it",
    "self-signed certificate": "another authority signed it",
    "self signed certificate": "another authority signed it",
    "signature failure": "another authority signed it",
    "mismatch, certificate is not valid for": "it is for another host",
    "wrong version number": "no TLS is spoken there",
    "unsuitable certificate purpose": "it is a router's, or is no router's where one is due",
    "key values mismatch": "certificate and private key do not belong together",
}


@dataclass(frozen=True, slots=True)
class Tls:
    """Certificate files for an encrypted connection, as `frictus pki` makes them (PEM).

    Attributes
    ----------
    authority : Path
        Certificate of the authority that both sides trust.
    certificate : Path
        Our own certificate; its private key stands beside it, with the suffix ``.key``.
    """

    authority: Path
    certificate: Path

    @property
    def key(self) -> Path:
        """The file of the private key."""
        return self.certificate.with_suffix(".key")

    def name(self, listens: bool = False) -> str:
        """Return the common name in our certificate, such as ``controller:alice``.

        Parameters
        ----------
        listens : bool
            Whether it is a router's, which others connect to.

        Raises
        ------
        CertificateError
            If a file is missing or no key or certificate, if the key is another's, or if the
            authority did not sign the certificate, or not for this side, or it has expired.
        """
        try:
            told = _shown_to_oneself(self, listens)
        except OSError as error:  # of which ssl.SSLError is one
            raise CertificateError(self._fault(error)) from error
        subject = {key: value for part in told["subject"] for key, value in part}
        return str(subject.get("commonName", ""))

    def _fault(self, error: OSError) -> str:
        for file in (self.authority, self.certificate, self.key):
            try:
                file.read_bytes()
            except OSError as missing:
                return f"{file}: cannot be read: {missing.strerror}; `frictus pki` makes it"
        return (
            f"certificate {self.certificate}: {_in_words(error)} (authority {self.authority}); "
            "`frictus pki show` tells more, `frictus pki issue` makes a new one"
        )


def why_refused(endpoint: str, tls: Tls, timeout_s: float) -> str:
    """Find out why no connection came about; empty if nothing is wrong with the certificates.

    Parameters
    ----------
    endpoint : str
        Such as ``tls/192.168.1.10:7447``.
    tls : Tls
        What was presented.
    timeout_s : float
        Longest wait for the other side.

    Raises
    ------
    CertificateError
        If our own files cannot be used.
    """
    name = tls.name()
    host, _, port = endpoint.removeprefix(SCHEME).rpartition(":")
    host = host.strip("[]")
    context = ssl.create_default_context(cafile=tls.authority)
    context.load_cert_chain(tls.certificate, tls.key)
    try:
        with (
            socket.create_connection((host, int(port)), timeout_s) as plain,
            context.wrap_socket(plain, server_hostname=host) as secure,
        ):
            secure.settimeout(_AFTER_HANDSHAKE_S)
            secure.recv(1)  # its alert, if it refuses us
    except ssl.SSLCertVerificationError as error:
        return f"the router's certificate: {_in_words(error)}"
    except ssl.SSLError as error:
        return f"our certificate {tls.certificate} ({name}): {_in_words(error)}"
    except OSError:
        return ""  # nobody listens, or it waits for more of us: not for want of a certificate
    return ""


def _shown_to_oneself(tls: Tls, listens: bool) -> dict[str, Any]:
    """Return what the other side reads in our certificate, by a handshake in memory."""
    router = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    client.check_hostname = False
    client.verify_mode = ssl.CERT_NONE
    judge = client if listens else router
    judge.verify_mode = ssl.CERT_REQUIRED
    judge.load_verify_locations(tls.authority)
    for context in (router, client):
        context.load_cert_chain(tls.certificate, tls.key)
    up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
    router_end = router.wrap_bio(up, down, server_side=True)
    client_end = client.wrap_bio(down, up)
    for end in (client_end, router_end, client_end):
        try:
            end.do_handshake()
        except ssl.SSLWantReadError:
            pass  # the other end's turn
    router_end.do_handshake()
    return (client_end if listens else router_end).getpeercert() or {}


def _in_words(error: OSError) -> str:
    said = f"{getattr(error, 'verify_message', '')} {error}"
    plain = said.lower().replace("_", " ")
    return next((words for sign, words in _WORDS.items() if sign in plain), said.strip())
