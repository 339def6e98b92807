"""The API's one connection to the rigs of its site."""

import threading
import time
from typing import Final

import frictus
from frictus.calls import require_present
from frictus.errors import LinkError
from frictus.keys import RigKeys

RETRY_S: Final = 1.0
TIMEOUT_S: Final = 2.0


class RigConnection:
    """Finds the rigs of one site. All methods block, and may be called from any thread.

    The router may come later than the API, and may go and come back: the first connection is
    tried again with later requests, and Zenoh mends one that breaks.

    Parameters
    ----------
    router : str
        Zenoh endpoint.
    site : str
        Site whose rigs are served.
    tls : Tls or None
        What the API presents to the router.
    """

    def __init__(self, router: str, site: str, tls: frictus.Tls | None = None) -> None:
        self.router = router
        self._tls = tls
        self.site = site
        self._client: frictus.Client | None = None
        self._connecting = threading.Lock()
        self._failed: tuple[float, LinkError] | None = None

    def client(self) -> frictus.Client:
        """Return the client; connect it if need be.

        Raises
        ------
        LinkError
            If no router answers, or if none did within the last second.
        """
        with self._connecting:
            if self._client is not None:
                return self._client
            if self._failed is not None and time.monotonic() - self._failed[0] < RETRY_S:
                raise self._failed[1]
            try:
                self._client = frictus.connect(self.router, timeout_s=TIMEOUT_S, tls=self._tls)
            except LinkError as error:
                self._failed = (time.monotonic(), error)
                raise
            return self._client

    def names(self) -> list[str]:
        """Return the names of the rigs that are present.

        Raises
        ------
        LinkError
        """
        return [rig.name for rig in self.client().rigs(self.site)]

    def rig(self, name: str) -> frictus.Rig:
        """Return a rig that is present.

        Raises
        ------
        NoRigError, LinkError
        """
        client = self.client()
        require_present(
            client.session, RigKeys(self.site, name)
        )  # at once: do not wait for one
        return client.rig(name, self.site)

    def recorder_of(self, name: str) -> frictus.Rig:
        """Return a rig, present or not: its recorder outlives it.

        Raises
        ------
        LinkError
        """
        client = self.client()
        return frictus.Rig(client.session, RigKeys(self.site, name), client.name, TIMEOUT_S)

    def close(self) -> None:
        """Leave the network."""
        with self._connecting:
            client, self._client = self._client, None
        if client is not None:
            client.close()
