"""Idempotency keys: a request that comes twice is carried out once.

The key is kept in the transaction that carries the request out, so that a crash keeps both or
neither. Keys are kept for ever: a row is smaller than what it guards.
"""

import hashlib
from dataclasses import dataclass
from typing import Self

from sqlalchemy import Connection, select, update

from frictus_service.registry.database import insert_or
from frictus_service.registry.errors import KeyReusedError
from frictus_service.registry.tables import requests


@dataclass(frozen=True, slots=True)
class Once:
    """A request that must not be carried out twice.

    Attributes
    ----------
    key : str
        Chosen by the caller, a new one for each request.
    fingerprint : str
        Hash of what is asked for.
    """

    key: str
    fingerprint: str

    @classmethod
    def of(cls, key: str, *content: bytes) -> Self:
        """Return the request of a key and what is asked for, such as method, path and body."""
        digest = hashlib.sha256()
        for part in content:
            digest.update(len(part).to_bytes(8, "big") + part)
        return cls(key, digest.hexdigest())

    def begin(self, connection: Connection, now_ns: int) -> str | None:
        """Return what this request made before; None, with the key taken, if it is new.

        A second request of the same key waits here until the first has committed.

        Raises
        ------
        KeyReusedError
            If the key came with something else before.
        """
        new = insert_or(connection, requests).values(
            key=self.key, fingerprint=self.fingerprint, made="", received_utc_ns=now_ns
        )
        taken = new.on_conflict_do_nothing().returning(requests.c.key)
        if connection.execute(taken).one_or_none() is not None:
            return None
        known = connection.execute(select(requests).where(requests.c.key == self.key)).one()
        if known.fingerprint != self.fingerprint:
            raise KeyReusedError(
                f"the idempotency key {self.key[:80]!r} came with another request before: "
                "take a new key for a new request"
            )
        return str(known.made)

    def finish(self, connection: Connection, made: str) -> None:
        """Keep what was made, in the transaction of `begin`."""
        connection.execute(update(requests).where(requests.c.key == self.key).values(made=made))
