"""Under which name rigs know whoever asks the API: a client for each person and for each page.

To a rig the API is not one client but many: what one page has armed, another page or a script
changes only where its holder shares it, and whoever stops a rig is named.
"""

import contextlib
import secrets
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

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
    def joined(self, person: str) -> Iterator[PageIdentity]:
        """Give a page its identity within the block.

        Parameters
        ----------
        person : str
            Name of its token.
        """
        client = f"{person}.page-{secrets.token_hex(3)}"
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
