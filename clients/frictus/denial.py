"""What to add where nothing came: a router with roles drops what it denies, without a word."""

from typing import Final

import zenoh

from frictus.tls import SCHEME

DENIED: Final = (
    "; or the router does not allow it to the role in your certificate: only a controller may "
    "command a rig (`frictus pki show FILE` tells the role)"
)
"""Where a call was not answered."""
UNKNOWN: Final = (
    "; or the router does not know the name in your certificate: put the certificate, not its "
    "key, into the router's folder of members, and start the router again"
)
"""Where nobody is present."""


def if_secured(session: zenoh.Session, hint: str) -> str:
    """Return what to add; empty without certificates.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    hint : str
        `DENIED` or `UNKNOWN`.
    """
    secured = any(str(link.dst).startswith(SCHEME) for link in session.info.links())
    return hint if secured else ""
