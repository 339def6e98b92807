"""Aliases stand for one version of a model; activations tell which rig was given which."""

import time
from typing import Any, TypeVar

from pydantic import BaseModel
from sqlalchemy import Connection, Row, Table, insert, select, update

from frictus_service.errors import AliasConflictError, UnknownModelError
from frictus_service.registry.database import Database
from frictus_service.registry.documents import (
    Activation,
    Alias,
    AliasMove,
    VersionSummary,
    check_alias,
    check_name,
)
from frictus_service.registry.tables import (
    activations,
    alias_moves,
    aliases,
    model_names,
    models,
)

Shown = TypeVar("Shown", bound=BaseModel)


class Aliases:
    """The aliases of a registry, and who moved them.

    Parameters
    ----------
    database : Database
        Of the registry.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def of(self, name: str) -> list[Alias]:
        """Return the aliases of a model, sorted.

        Raises
        ------
        RegistryNameError
        """
        query = select(aliases).where(aliases.c.name == check_name(name))
        with self._database.read() as connection:
            rows = connection.execute(query.order_by(aliases.c.alias)).all()
        return [_alias(row) for row in rows]

    def get(self, name: str, alias: str) -> Alias | None:
        """Return an alias; None if it was never made.

        Raises
        ------
        RegistryNameError
        """
        with self._database.read() as connection:
            return _alias_of(connection, check_name(name), check_alias(alias))

    def move(
        self,
        name: str,
        alias: str,
        version: int,
        *,
        by: str,
        reason: str = "",
        replaces: str | None,
    ) -> Alias:
        """Let an alias stand for a version from now on; the move is kept in the audit.

        Parameters
        ----------
        name, alias : str
            Of the model, and what stands for one of its versions.
        version : int
            A published version of `name`.
        by, reason : str
            Who, and why.
        replaces : str or None
            Etag of the alias as the caller saw it, ``*`` for any, None where it must be new.

        Raises
        ------
        RegistryNameError, UnknownModelError, AliasConflictError
        """
        check_name(name)
        check_alias(alias)
        with self._database.write() as connection:
            _hold(connection, name)
            _check_version(connection, name, version)
            before = _alias_of(connection, name, alias)
            _check_replaced(before, f"{name}@{alias}", replaces)
            row = {
                "version": version,
                "revision": before.revision + 1 if before else 1,
                "moved_utc_ns": time.time_ns(),
            }
            here = {"name": name, "alias": alias}
            if before is None:
                connection.execute(insert(aliases).values(**here, **row))
            else:
                same = (aliases.c.name == name) & (aliases.c.alias == alias)
                connection.execute(update(aliases).where(same).values(**row))
            connection.execute(
                insert(alias_moves).values(
                    **here,
                    revision=row["revision"],
                    from_version=before.version if before else None,
                    to_version=version,
                    moved_utc_ns=row["moved_utc_ns"],
                    moved_by=by,
                    reason=reason,
                )
            )
        return Alias(name=name, alias=alias, **row)

    def moves(self, name: str, limit: int) -> list[AliasMove]:
        """Return the newest moves of a model's aliases, newest first.

        Raises
        ------
        RegistryNameError
        """
        return _newest(self._database, alias_moves, AliasMove, name, limit)


def _check_version(connection: Connection, name: str, version: int) -> None:
    same = (models.c.name == name) & (models.c.version == version)
    if connection.execute(select(models.c.id).where(same)).one_or_none() is None:
        raise UnknownModelError(f"no model {name}@{version} was published")


def _hold(connection: Connection, name: str) -> None:
    """Let nobody else move an alias of this name until we are done."""
    connection.execute(
        select(model_names.c.name).where(model_names.c.name == name).with_for_update()
    )


def _alias_of(connection: Connection, name: str, alias: str) -> Alias | None:
    query = select(aliases).where(aliases.c.name == name, aliases.c.alias == alias)
    row = connection.execute(query).one_or_none()
    return _alias(row) if row is not None else None


def _check_replaced(before: Alias | None, which: str, replaces: str | None) -> None:
    if replaces is None and before is not None:
        raise AliasConflictError(f"there is {which} already: its etag is {before.etag}")
    if replaces not in (None, "*") and (before is None or before.etag != replaces):
        stands = f"its etag is {before.etag}" if before else "it was never made"
        raise AliasConflictError(f"{which} does not stand where it was seen: {stands}")


def _alias(row: Row[Any]) -> Alias:
    return Alias.model_validate(row._mapping)


class Activations:
    """The activations of a registry.

    Parameters
    ----------
    database : Database
        Of the registry.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def record(
        self, version: VersionSummary, *, site: str, rig: str, confirmed: str, by: str
    ) -> Activation:
        """Keep that a rig was given a version.

        Parameters
        ----------
        version : VersionSummary
            What was published.
        site, rig : str
            Of the rig.
        confirmed : str
            Etag of the model that the rig says it applies.
        by : str
            Who asked for it.
        """
        activation = Activation(
            site=site,
            rig=rig,
            name=version.name,
            version=version.version,
            etag=version.etag,
            confirmed=confirmed,
            activated_utc_ns=time.time_ns(),
            activated_by=by,
        )
        with self._database.write() as connection:
            connection.execute(insert(activations).values(**activation.model_dump()))
        return activation

    def of(self, name: str, limit: int) -> list[Activation]:
        """Return the newest activations of a model, newest first.

        Raises
        ------
        RegistryNameError
        """
        return _newest(self._database, activations, Activation, name, limit)


def _newest(
    database: Database, table: Table, shown: type[Shown], name: str, limit: int
) -> list[Shown]:
    """Return the newest rows of a model in a table, newest first."""
    query = select(table).where(table.c.name == check_name(name))
    with database.read() as connection:
        rows = connection.execute(query.order_by(table.c.id.desc()).limit(limit)).all()
    return [shown.model_validate(row._mapping) for row in rows]
