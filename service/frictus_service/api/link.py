"""The API's one connection to the rigs of its site, as a client like any other."""

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Final

import frictus
from frictus.calls import Caller, require_present
from frictus.errors import LinkError, RefusedError
from frictus.keys import RigKeys
from frictus.messages import Reply

RETRY_S: Final = 1.0
TIMEOUT_S: Final = 2.0
SEEN_S: Final = 0.5


class RigLink:
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

    def replace_scene(self, name: str, scene: frictus.Scene, replaces: str | None) -> Reply:
        """Replace the scene whose etag is `replaces` (None: any), and return the reply.

        Raises
        ------
        RefusedError, NoRigError, LinkError
        """
        reply = self._call(name, "scene", scene=scene, if_match=replaces)
        self._wait_until(lambda: self.rig(name).scene().etag == reply.etag)
        return reply

    def replace_model(self, name: str, model: frictus.Model, replaces: str | None) -> Reply:
        """Replace the model whose etag is `replaces` (None: any), and return the reply.

        Raises
        ------
        RefusedError, NoRigError, LinkError
        """
        reply = self._call(name, "model", model=model, if_match=replaces)
        self._wait_until(lambda: self.rig(name).model().etag == reply.etag)
        return reply

    def command(self, name: str, call: str) -> Reply:
        """Ask for `stop` or `reset`, and return the reply.

        Raises
        ------
        RefusedError, NoRigError, LinkError
        """
        return self._call(name, call)

    def close(self) -> None:
        """Leave the network."""
        with self._connecting:
            client, self._client = self._client, None
        if client is not None:
            client.close()

    def _call(self, name: str, call: str, **fields: object) -> Reply:
        rig = self.rig(name)
        client = self.client()
        try:
            return Caller(client.session, rig.keys, client.name, TIMEOUT_S).call(call, **fields)
        except RefusedError as error:
            if error.code != "not_owner":
                raise
            owner = rig.status().owner
            raise RefusedError(
                error.code, f"{error} (rig {name!r} is held by {owner!r})"
            ) from error

    def _wait_until(self, seen: Callable[[], bool]) -> None:
        """Wait for what a rig publishes after its reply, so that a GET shows what was PUT."""
        deadline_s = time.monotonic() + SEEN_S
        with contextlib.suppress(LookupError, ConnectionError):
            while not seen() and time.monotonic() < deadline_s:
                time.sleep(0.005)
