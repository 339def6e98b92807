"""One database, SQLite or PostgreSQL, and requests that it carries out once.

SQLite writes ahead (WAL) with every commit on the disk (FULL), and a writer takes the lock when
it begins, so that it never fails half-way because another came first. A relative file name in
the URL is relative to the working folder.

Idempotency keys: a request that comes twice is carried out once.

The key is kept in the transaction that carries the request out, so that a crash keeps both or
neither. Keys are kept for ever: a row is smaller than what it guards.
"""

import contextlib
import hashlib
import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

from sqlalchemy import (
    URL,
    Connection,
    Engine,
    Table,
    create_engine,
    event,
    inspect,
    make_url,
    select,
    text,
    update,
)
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import ArgumentError, IntegrityError, SQLAlchemyError

from frictus_service.errors import KeyReusedError, RegistryUnavailableError
from frictus_service.registry.sqlite_file import require_sqlite_file
from frictus_service.registry.tables import requests

MIGRATIONS: Final = Path(__file__).parent / "migrations"
DRIVERS: Final = ("sqlite", "postgresql+psycopg")
BUSY_MS: Final = 10_000
"""How long SQLite waits for another writer; a write takes milliseconds."""
FREE_S: Final = 1.0
"""How long a thread waits for a connection: while all hang, others have work to do."""
_AHEAD: Final = ("-wal", "-shm")
"""Ends of the names of the files beside a SQLite file that is in use."""
_ADVICE: Final = {
    "disk I/O error": "its file, its -wal or its -shm was deleted or replaced while a process "
    "has it open, or the disk fails: end every frictus that uses it, and put back what was "
    "taken away; to begin an empty one, move all three elsewhere",
    "readonly database": "the account that frictus runs under must be allowed to write the "
    "file and its folder",
    "unable to open database file": "its folder has to be there, and the account that frictus "
    "runs under must be allowed to read and write both; see registry.url in the configuration",
    "malformed": "put a backup back (docs/registry.md)",
    "no such": "something else than frictus has changed its tables: put a backup back "
    "(docs/registry.md)",
    "disk is full": "make room there, and ask again",
    "locked": f"another program has written it for more than {BUSY_MS / 1e3:g} s: end that "
    "one, or ask again",
}
"""What to do, by what SQLite says."""
_UPGRADE_LOCK: Final = 0x66726963
"""Any number; PostgreSQL lets one process at a time bring the tables up to date."""


class Database:
    """A database of the registry; any thread may use it.

    Parameters
    ----------
    url : str
        ``sqlite:///FILE`` or ``postgresql+psycopg://USER:PASSWORD@HOST/NAME``.

    Raises
    ------
    RegistryUnavailableError
        If the URL is not one.
    """

    def __init__(self, url: str) -> None:
        try:
            self._url = make_url(url)
        except ArgumentError as error:
            raise RegistryUnavailableError(
                f"registry.url is no database URL: {error}"
            ) from error
        if self._url.drivername not in DRIVERS:
            raise RegistryUnavailableError(
                f"registry.url {self}: sqlite:///FILE and postgresql+psycopg://... are accepted"
            )
        self._opening = threading.Lock()
        self._engine: Engine | None = None
        self._file: tuple[int, int] | None = None
        self._ahead: list[str] = []
        self._failure = ""

    def __str__(self) -> str:
        """Return the URL without its password."""
        return self._url.render_as_string(hide_password=True)

    @property
    def exists(self) -> bool:
        """Whether there may be anything in it: False only for a file that never was there."""
        return not self._is_file or self._engine is not None or self._place is not None

    def require_file(self) -> None:
        """Look at the file of SQLite, where it is one, without opening it.

        Raises
        ------
        RegistryUnavailableError
            If something else bears its name.
        """
        if self._is_file:
            require_sqlite_file(self._url.database or "")

    @property
    def usable(self) -> bool:
        """Whether it can be reached; a file that is not there yet can be made."""
        if not self.exists:
            return os.access(
                os.path.dirname(self._url.database or "") or ".", os.W_OK | os.X_OK
            )
        try:
            with self.read() as connection:
                connection.execute(text("SELECT 1"))
        except RegistryUnavailableError:
            return False
        return True

    @contextlib.contextmanager
    def read(self) -> Iterator[Connection]:
        """Give a connection that sees one state of the database.

        Raises
        ------
        RegistryUnavailableError
        """
        with self._told(), self._opened().connect() as connection:
            yield connection

    @contextlib.contextmanager
    def write(self) -> Iterator[Connection]:
        """Give a connection whose changes are all kept, on the disk, or none of them.

        Raises
        ------
        RegistryUnavailableError
        """
        with self._told(), self._opened().connect() as connection:
            connection = connection.execution_options(frictus_write=True)
            with connection.begin():
                self._require_journal()
                yield connection

    def close(self) -> None:
        """Close every connection. Using the database again opens it again."""
        with self._opening:
            engine, self._engine = self._engine, None
        if engine is not None:
            engine.dispose()

    def _opened(self) -> Engine:
        if (engine := self._engine) is not None:
            if self._file != self._place:  # what is written now would go with the process
                raise RegistryUnavailableError(
                    f"the registry {self} was deleted, moved or replaced while it was in use: "
                    "move the file back; or end frictus, and start it with what is there now"
                )
            return engine
        failed = self._failure
        # Once it has failed, one thread tries again; the others, up to all of a server, need
        # not stand in line for it.
        if not self._opening.acquire(blocking=not failed):
            raise RegistryUnavailableError(failed)
        try:
            if self._engine is None:
                # While this thread waited, another one tried.
                if self._failure and self._failure != failed:
                    raise RegistryUnavailableError(self._failure)
                engine = self._open()
                self._ahead = [
                    end for end in _AHEAD if os.path.exists(f"{self._url.database}{end}")
                ]
                self._file, self._engine = self._place, engine
            return self._engine
        finally:
            self._opening.release()

    def _open(self) -> Engine:
        self.require_file()
        engine = _sqlite(self._url) if self._is_file else _server(self._url)
        try:
            with self._told():
                self._upgrade(engine)
        except BaseException as error:
            engine.dispose()
            if isinstance(error, RegistryUnavailableError):
                self._failure = str(error)
            raise
        self._failure = ""
        return engine

    @property
    def _is_file(self) -> bool:
        return self._url.drivername == "sqlite"

    @property
    def _place(self) -> tuple[int, int] | None:
        """What the disk knows the file by; None: there is none, or none is meant."""
        if not self._is_file:
            return None
        try:
            found = os.stat(self._url.database or "")
        except FileNotFoundError:
            return None
        except OSError:
            return -1, -1  # something is there, which cannot be looked at
        return found.st_dev, found.st_ino

    def _upgrade(self, engine: Engine) -> None:
        from alembic import command  # late: what starts a process waits for every import
        from alembic.config import Config as AlembicConfig
        from alembic.util import CommandError

        alembic = AlembicConfig()
        alembic.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
        with engine.connect() as connection:
            connection = connection.execution_options(frictus_write=True)
            with connection.begin():
                if not self._is_file:
                    connection.execute(
                        text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _UPGRADE_LOCK}
                    )
                tables = inspect(connection).get_table_names()
                if tables and "alembic_version" not in tables:
                    few = ", ".join(sorted(tables)[:3])
                    raise RegistryUnavailableError(
                        f"the registry {self} holds the tables of another program ({few}): "
                        "name a database of its own in registry.url of the configuration; it "
                        "may be empty, and a file is made where there is none"
                    )
                alembic.attributes["connection"] = connection
                try:
                    command.upgrade(alembic, "head")
                except CommandError as error:
                    raise RegistryUnavailableError(
                        f"the registry {self} was written by another version of frictus, which "
                        f"this one cannot read ({error}): install that version or a newer one"
                    ) from error

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except IntegrityError:
            raise  # for whoever knows which rule was broken
        except SQLAlchemyError as error:
            reason = str(getattr(error, "orig", None) or error).strip().replace("\n", " ")
            known = (todo for said, todo in _ADVICE.items() if said in reason)
            raise RegistryUnavailableError(
                f"the registry {self} cannot be used: {reason}; "
                + next(known, "see registry.url in the configuration")
            ) from error

    def _require_journal(self) -> None:
        """Raise where what is committed stands in a file that has no name any more."""
        # A connection that is open has them; a kill would take what only they hold.
        gone = [end for end in self._ahead if not os.path.exists(f"{self._url.database}{end}")]
        if gone:
            raise RegistryUnavailableError(
                f"the registry {self} takes nothing more: {' and '.join(gone)} beside its file "
                "was deleted while it was in use. End every frictus that uses it by Ctrl-C, "
                "which keeps what was confirmed, then start again; a kill would lose it"
            )


def insert_or(connection: Connection, table: Table) -> sqlite.Insert | postgresql.Insert:
    """Return an INSERT that knows ``on_conflict_do_nothing`` and ``on_conflict_do_update``."""
    if connection.dialect.name == "sqlite":
        return sqlite.insert(table)
    return postgresql.insert(table)


def _sqlite(url: URL) -> Engine:
    engine = create_engine(url, pool_timeout=FREE_S)

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, _record: object) -> None:
        connection.isolation_level = None  # transactions begin below, schema changes included
        for pragma in (
            f"busy_timeout = {BUSY_MS}",
            "journal_mode = WAL",
            "synchronous = FULL",
            "foreign_keys = ON",
        ):
            connection.execute(f"PRAGMA {pragma}").close()

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        writes = connection.get_execution_options().get("frictus_write", False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def _server(url: URL) -> Engine:
    try:
        # A connection that the server has closed meanwhile is opened again, not passed on.
        return create_engine(
            url,
            pool_pre_ping=True,
            pool_timeout=FREE_S,
            connect_args={"connect_timeout": 5},
        )
    except ModuleNotFoundError as error:
        raise RegistryUnavailableError(
            "the registry is on PostgreSQL, whose driver is missing: "
            "pip install 'frictus[postgres]'"
        ) from error


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
        return self.known(connection)

    def known(self, connection: Connection) -> str | None:
        """Return what this request made before; None if it is new, or under way.

        Raises
        ------
        KeyReusedError
            If the key came with something else before.
        """
        query = select(requests).where(requests.c.key == self.key)
        if (known := connection.execute(query).one_or_none()) is None:
            return None
        if known.fingerprint != self.fingerprint:
            raise KeyReusedError(
                f"the idempotency key {self.key[:80]!r} came with another request before: "
                "take a new key for a new request"
            )
        return str(known.made)

    def finish(self, connection: Connection, made: str) -> None:
        """Keep what was made, in the transaction of `begin`."""
        connection.execute(update(requests).where(requests.c.key == self.key).values(made=made))
