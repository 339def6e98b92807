"""The registry: models under names, in versions that never change."""

import time
from typing import Any, Final, Literal

from pydantic import ValidationError
from sqlalchemy import Column, Connection, Row, insert, select

from frictus.closing import Closing
from frictus.errors import explain
from frictus.model import Model
from frictus_service.errors import (
    RegistryUnavailableError,
    UnknownCalibrationError,
    UnknownModelError,
)
from frictus_service.json_text import etag_of
from frictus_service.registry.aliases import Activations, Aliases
from frictus_service.registry.calibrations import Calibrations
from frictus_service.registry.database import Database, Once, insert_or
from frictus_service.registry.documents import (
    Published,
    Reference,
    VersionPage,
    VersionSummary,
    check_name,
    check_provenance,
    parse_reference,
)
from frictus_service.registry.tables import aliases, calibrations, model_names, models

_SUMMARY: Final[list[Column[Any]]] = [models.c[field] for field in VersionSummary.model_fields]


class Registry(Closing):
    """Models by name and version; any thread and any number of processes may use it.

    Nothing is opened, and no file is made, before its first use.

    Parameters
    ----------
    url : str
        ``sqlite:///FILE`` or ``postgresql+psycopg://USER:PASSWORD@HOST/NAME``.

    Attributes
    ----------
    database : Database
        What everything is kept in.
    aliases : Aliases
        Names that stand for a version and move.
    activations : Activations
        Which rig was given which version.
    calibrations : Calibrations
        The calibrations behind the models.

    Raises
    ------
    RegistryUnavailableError
        If the URL is not one; every method raises it when the database cannot be reached.
    """

    def __init__(self, url: str) -> None:
        self.database = Database(url)
        self.aliases = Aliases(self.database)
        self.activations = Activations(self.database)
        self.calibrations = Calibrations(self.database)

    def close(self) -> None:
        """Close the database."""
        self.database.close()

    def publish(
        self,
        model: Model,
        name: str,
        *,
        by: str,
        rig: str | None = None,
        comment: str = "",
        calibration: str | None = None,
        once: Once | None = None,
    ) -> Published:
        """Publish a model as the next version of a name; when this returns, it is on the disk.

        Parameters
        ----------
        model : Model
            With provenance, see `check_provenance`.
        name : str
            One or two parts, such as ``population`` or ``rig1/P01``.
        by : str
            Who publishes it.
        rig : str or None
            On which rig it was measured.
        comment : str
            For people.
        calibration : str or None
            Id of the calibration that measured it. It is published once: asking again returns
            the version that it became.
        once : Once or None
            Idempotency key: the same request again returns what the first one published.

        Raises
        ------
        RegistryNameError, ProvenanceError, KeyReusedError
        """
        check_name(name)
        check_provenance(model)
        with self.database.write() as connection:
            now_ns = time.time_ns()
            if once is not None and (made := once.begin(connection, now_ns)) is not None:
                return _published(_find(connection, parse_reference(made)))
            row = _measured(connection, calibration) if calibration is not None else None
            row = (
                row
                or connection.execute(
                    insert(models)
                    .values(
                        name=name,
                        version=_next_version(connection, name),
                        etag=etag_of(model),
                        response=model.response,
                        participant=model.participant,
                        rig=rig,
                        document=model.to_json().decode(),
                        published_utc_ns=now_ns,
                        published_by=by,
                        comment=comment,
                        calibration=calibration,
                        simulated=model.simulated,
                    )
                    .returning(models)
                ).one()
            )
            published = _published(row)
            if once is not None:
                once.finish(connection, published.reference)
        return published

    def get(self, reference: str) -> Published:
        """Return a published version.

        Parameters
        ----------
        reference : str
            ``NAME@VERSION``, ``NAME@ALIAS``, or ``NAME`` for the newest version.

        Raises
        ------
        RegistryNameError, UnknownModelError
        """
        wanted = parse_reference(reference)
        with self.database.read() as connection:
            return _published(_find(connection, wanted))

    def find(
        self,
        *,
        name: str | None = None,
        participant: str | None = None,
        rig: str | None = None,
        response: Literal["friction", "mobility"] | None = None,
        population: bool | None = None,
        newest: bool = False,
        after: int = 0,
        limit: int = 100,
    ) -> VersionPage:
        """Return published versions, newest first.

        Parameters
        ----------
        name, participant, rig, response
            Only those; None: any.
        population : bool or None
            True: only models of no participant; False: only of participants.
        newest : bool
            Only the newest version of each name.
        after : str
            `next` of the page before; 0: the first page.
        limit : int
            Longest page, 1 or more.
        """
        query = select(*_SUMMARY, models.c.id).order_by(models.c.id.desc()).limit(limit + 1)
        wanted = {"name": name, "participant": participant, "rig": rig, "response": response}
        for field, value in wanted.items():
            if value is not None:
                query = query.where(models.c[field] == value)
        if population is not None:
            anyone = models.c.participant
            query = query.where(anyone.is_(None) if population else anyone.is_not(None))
        if newest:
            query = query.join(model_names).where(
                models.c.version == model_names.c.last_version
            )
        if after:
            query = query.where(models.c.id < after)
        with self.database.read() as connection:
            rows = connection.execute(query).all()
        more = int(rows[limit - 1].id) if len(rows) > limit else None
        return VersionPage(models=[_summary(row) for row in rows[:limit]], next=more)


def _next_version(connection: Connection, name: str) -> int:
    # Counted in one statement that locks the name's row: no two writers get the same number,
    # and a transaction that fails gives its number back.
    count = insert_or(connection, model_names).values(name=name, last_version=1)
    count = count.on_conflict_do_update(
        index_elements=["name"], set_={"last_version": model_names.c.last_version + 1}
    )
    return int(connection.execute(count.returning(model_names.c.last_version)).scalar_one())


def _measured(connection: Connection, calibration: str) -> Row[Any] | None:
    """Return what a calibration was published as; its row is locked until we have published."""
    held = select(calibrations.c.id).where(calibrations.c.id == calibration).with_for_update()
    if connection.execute(held).one_or_none() is None:
        raise UnknownCalibrationError(f"no calibration {calibration[:80]!r}")
    query = select(models).where(models.c.calibration == calibration)
    return connection.execute(query).one_or_none()


def _find(connection: Connection, wanted: Reference) -> Row[Any]:
    query = select(models).where(models.c.name == wanted.name)
    if isinstance(wanted.which, int):
        query = query.where(models.c.version == wanted.which)
    elif wanted.which is not None:
        same = (aliases.c.name == models.c.name) & (aliases.c.version == models.c.version)
        query = query.join(aliases, same).where(aliases.c.alias == wanted.which)
    else:
        query = query.order_by(models.c.version.desc()).limit(1)
    row = connection.execute(query).one_or_none()
    if row is None:
        raise UnknownModelError(f"no model {wanted}: {_what_there_is(connection, wanted.name)}")
    return row


def _what_there_is(connection: Connection, name: str) -> str:
    count = select(model_names.c.last_version).where(model_names.c.name == name)
    last = connection.execute(count).scalar_one_or_none()
    if last is None:
        return f"nothing was published as {name!r}"
    made = select(aliases.c.alias).where(aliases.c.name == name).order_by(aliases.c.alias)
    known = ", ".join(connection.execute(made).scalars()) or "none"
    return f"{name!r} has the versions 1 to {last} and the aliases: {known}"


def _summary(row: Row[*tuple[Any, ...]]) -> VersionSummary:
    return VersionSummary.model_validate(row._mapping)


def _published(row: Row[Any]) -> Published:
    try:
        model = Model.model_validate_json(row.document)
    except ValidationError as error:
        raise RegistryUnavailableError(
            f"the registry holds {row.name}@{row.version} in a form that this version of "
            f"frictus cannot read ({explain(error)}): update frictus, or put a backup back "
            "(docs/registry.md)"
        ) from error
    return Published.model_validate({**row._mapping, "model": model})


MOST: Final = 200
_LAW: Final = frozenset({"gain_n", "cutoff_0_hz", "slope_hz_per_mm_s"})


def earlier_people(registry: Registry, besides: str) -> tuple[Model, ...]:
    """Return the newest published friction model of each participant, newest first.

    Models without a covariance of their law are left out: nothing can be learned from them.

    Parameters
    ----------
    registry : Registry
        Of published models.
    besides : str
        Pseudonym of a participant whose own models are left out.
    """
    found: dict[str, Model] = {}
    after = 0
    while len(found) < MOST:
        page = registry.find(population=False, response="friction", newest=True, after=after)
        for summary in page.models:
            person = summary.participant
            if person is None or person == besides or person in found:
                continue
            model = registry.get(summary.reference).model
            if model.covariance is not None and _LAW <= set(model.covariance.parameters):
                found[person] = model
        if page.next is None:
            break
        after = page.next
    return tuple(found.values())
