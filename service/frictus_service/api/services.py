"""What the paths of the API work with: callers by name, and the connection to the rigs.

Under which name rigs know whoever asks the API: a client for each person and for each page.

To a rig the API is not one client but many: what one page has armed, another page or a script
changes only where its holder shares it, and whoever stops a rig is named.
"""

import contextlib
import secrets
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Final

from fastapi import Depends, Request

import frictus
from frictus.calls import require_present
from frictus.errors import LinkError
from frictus.keys import RigKeys
from frictus_service.api.own_process import OwnProcesses
from frictus_service.config import Config
from frictus_service.jobs.calibrations import CalibrationEngine
from frictus_service.jobs.discoveries import DiscoveryEngine
from frictus_service.jobs.experiments import ExperimentEngine
from frictus_service.library import TextureLibrary
from frictus_service.registry.store import Registry

PAGE_HEADER: Final = "Frictus-Page"
"""With the key of a page in it, a request acts as that page."""


@dataclass(frozen=True, slots=True)
class PageIdentity:
    """What a connected page is called, and by what its requests are known.

    Attributes
    ----------
    person : str
        Name of its token.
    client : str
        Its name to the rigs.
    key : str
        Secret of the page and the API.
    """

    person: str
    client: str
    key: str


class ConnectedPages:
    """The pages that are connected. Joined by the event loop, asked by any thread."""

    def __init__(self) -> None:
        self._pages: dict[str, PageIdentity] = {}

    @contextlib.contextmanager
    def joined(self, person: str, kind: str = "page") -> Iterator[PageIdentity]:
        """Give a page its identity within the block.

        Parameters
        ----------
        person : str
            Name of its token.
        kind : str
            ``page`` or ``participant``: `frictus.keys.spoken_name` says it to people.
        """
        client = f"{person}.{kind}-{secrets.token_hex(3)}"
        page = PageIdentity(person, client, secrets.token_urlsafe(16))
        self._pages[page.key] = page
        try:
            yield page
        finally:
            del self._pages[page.key]

    def client_of(self, person: str, key: str | None) -> str:
        """Return the client as which a request acts.

        Parameters
        ----------
        person : str
            Name of its token.
        key : str or None
            Of the page that it says it comes from; one that is not connected, or another
            person's, counts as none.
        """
        page = None if key is None else self._pages.get(key)
        if page is None or page.person != person:
            return f"{person}.rest"
        return page.client


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
    patient : bool
        Whether the link, and with it what pages hold, outlasts that a busy machine sets the
        process aside for some seconds; see `frictus.session.PATIENT_LEASE_MS`.
    """

    def __init__(
        self, router: str, site: str, tls: frictus.Tls | None = None, patient: bool = False
    ) -> None:
        self.router = router
        self._tls = tls
        self._patient = patient
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
                self._client = frictus.connect(
                    self.router, timeout_s=TIMEOUT_S, tls=self._tls, patient=self._patient
                )
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


@dataclass(frozen=True, slots=True)
class Services:
    """Configuration, rigs, textures, registry, engines of each kind of job, pages, commands."""

    config: Config
    link: RigConnection
    library: TextureLibrary
    registry: Registry
    calibrations: CalibrationEngine
    discoveries: DiscoveryEngine
    experiments: ExperimentEngine
    pages: ConnectedPages
    commands: OwnProcesses

    def stop_jobs(self) -> None:
        """Tell all jobs to stop, and end commands: streams and answers end, too."""
        self.commands.close()
        for each in (self.calibrations, self.discoveries, self.experiments):
            each.stop()


def services(request: Request) -> Services:
    """Return the services of the app that serves `request`."""
    found: Services = request.app.state.services
    return found


async def _given(request: Request) -> Services:
    return services(request)  # in the event loop: a stop may not wait for a thread


Given = Annotated[Services, Depends(_given)]
"""The services, as a path asks for them."""
