"""What to add where nothing came: a router with roles drops what it denies, without a word."""

import zenoh

from frictus.tls import SCHEME


def if_denied(session: zenoh.Session) -> str:
    """Return what to add where a call was not answered; empty without certificates.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    """
    if not _secured(session):
        return ""
    return (
        "; or the router does not allow it to the role in your certificate: only a controller "
        "may command a rig (`frictus pki show FILE` tells the role)"
    )


def if_unknown(session: zenoh.Session) -> str:
    """Return what to add where nobody is present; empty without certificates.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    """
    if not _secured(session):
        return ""
    return (
        "; or the router does not know the name in your certificate: put the certificate, not "
        "its key, into the router's folder of members, and start the router again"
    )


def _secured(session: zenoh.Session) -> bool:
    return any(str(link.dst).startswith(SCHEME) for link in session.info.links())
