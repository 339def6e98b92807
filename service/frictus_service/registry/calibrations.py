"""Calibrations as the registry keeps them: what was asked, where it stands, what it told."""

import json
import secrets
import time
from collections.abc import Sequence
from typing import Any, Final

from pydantic import BaseModel
from sqlalchemy import Connection, Executable, Row, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress
from frictus_service.errors import (
    CalibrationStateError,
    RigBusyError,
    UnknownCalibrationError,
)
from frictus_service.job_folder import ACTIVE, State
from frictus_service.registry.database import Database, Once
from frictus_service.registry.documents import (
    Calibration,
    CalibrationEvent,
    CalibrationPage,
)
from frictus_service.registry.tables import calibration_events, calibrations, models

_ALL: Final = (
    select(calibrations, models.c.name, models.c.version)
    .select_from(calibrations)
    .outerjoin(models, models.c.calibration == calibrations.c.id)
)
_DOCUMENTS: Final[dict[str, type[BaseModel]]] = {
    "spec": CalibrationSpec,
    "progress": Progress,
    "result": CalibrationResult,
}


class Calibrations:
    """The calibrations of a registry.

    Parameters
    ----------
    database : Database
        Of the registry.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def create(
        self, spec: CalibrationSpec, *, site: str, by: str, once: Once | None = None
    ) -> tuple[Calibration, bool]:
        """Queue a calibration; return it, and whether it is new.

        Parameters
        ----------
        spec : CalibrationSpec
            What the calibration is asked for.
        site : str
            Of the rig.
        by : str
            Who asks.
        once : Once or None
            Idempotency key: the same request again returns what the first one made.

        Raises
        ------
        RigBusyError, KeyReusedError
        """
        now_ns = time.time_ns()
        with self._database.write() as connection:
            if once is not None and (made := once.begin(connection, now_ns)) is not None:
                return _get(connection, made), False
            row = {
                "id": _new_id(now_ns),
                "site": site,
                "rig": spec.rig,
                "participant": spec.participant,
                "state": "queued",
                "spec": spec.model_dump_json(by_alias=True),
                "created_utc_ns": now_ns,
                "created_by": by,
                "updated_utc_ns": now_ns,
            }
            _or_busy(connection, site, spec.rig, insert(calibrations).values(**row))
            _tell(connection, str(row["id"]), now_ns, "state", json.dumps("queued"))
            if once is not None:
                once.finish(connection, str(row["id"]))
            return _get(connection, str(row["id"])), True

    def made_by(self, once: Once) -> Calibration | None:
        """Return the calibration that a request made before; None if it is new.

        Raises
        ------
        KeyReusedError
        """
        with self._database.read() as connection:
            made = once.known(connection)
            return None if made is None else _get(connection, made)

    def get(self, calibration: str) -> Calibration:
        """Return a calibration.

        Raises
        ------
        UnknownCalibrationError
        """
        with self._database.read() as connection:
            return _get(connection, calibration)

    def state(self, calibration: str) -> State:
        """Return in which state a calibration is: what was asked of it may be long.

        Raises
        ------
        UnknownCalibrationError
        """
        query = select(calibrations.c.state).where(calibrations.c.id == calibration)
        with self._database.read() as connection:
            found: State | None = connection.execute(query).scalar_one_or_none()
        if found is None:
            raise _unknown(calibration)
        return found

    def find(
        self,
        *,
        rig: str | None = None,
        participant: str | None = None,
        state: State | None = None,
        after: str = "",
        limit: int = 100,
    ) -> CalibrationPage:
        """Return calibrations, newest first.

        Parameters
        ----------
        rig, participant, state
            Only those; None: any.
        after : str
            `next` of the page before.
        limit : int
            Longest page, 1 or more.
        """
        query = _ALL.order_by(calibrations.c.id.desc()).limit(limit + 1)
        wanted = {"rig": rig, "participant": participant, "state": state}
        for field, value in wanted.items():
            if value is not None:
                query = query.where(calibrations.c[field] == value)
        if after:
            query = query.where(calibrations.c.id < after)
        with self._database.read() as connection:
            rows = connection.execute(query).all()
        more = str(rows[limit - 1].id) if len(rows) > limit else None
        return CalibrationPage(
            calibrations=[_calibration(row) for row in rows[:limit]], next=more
        )

    def active_on(self, site: str, rig: str) -> Calibration | None:
        """Return the calibration that is queued or runs on a rig; None where there is none."""
        of_rig = (calibrations.c.site == site) & (calibrations.c.rig == rig)
        query = _ALL.where(of_rig, calibrations.c.state.in_(ACTIVE))
        with self._database.read() as connection:
            row = connection.execute(query).one_or_none()
        return None if row is None else _calibration(row)

    def active_at(self, site: str) -> list[str]:
        """Return the ids of the calibrations of a site that are queued or run."""
        here = (calibrations.c.site == site) & calibrations.c.state.in_(ACTIVE)
        with self._database.read() as connection:
            return list(connection.execute(select(calibrations.c.id).where(here)).scalars())

    def change(
        self,
        calibration: str,
        to: State,
        *,
        of: Sequence[State],
        result: CalibrationResult | None = None,
        failure: str | None = None,
    ) -> Calibration:
        """Put a calibration into another state, and return it.

        Parameters
        ----------
        calibration : str
            Its id.
        to : str
            The new state.
        of : sequence of str
            States that it may be in now.
        result : CalibrationResult or None
            What came of it; with ``done``, and only then.
        failure : str or None
            Why it failed; with ``failed``, and only then.

        Raises
        ------
        UnknownCalibrationError, CalibrationStateError, RigBusyError
        """
        now_ns = time.time_ns()
        here = (calibrations.c.id == calibration) & calibrations.c.state.in_(of)
        values = {
            "state": to,
            "updated_utc_ns": now_ns,
            "result": result.model_dump_json(by_alias=True) if result else None,
            "failure": failure,
        }
        with self._database.write() as connection:
            standing = _get(connection, calibration)
            moved = update(calibrations).where(here).values(**values)
            if _or_busy(connection, standing.site, standing.rig, moved) != 1:
                raise CalibrationStateError(
                    f"calibration {calibration} is {standing.state}: this is for one that is "
                    f"{' or '.join(of)}"
                )
            _tell(connection, calibration, now_ns, "state", json.dumps(to))
            return _get(connection, calibration)

    def progress(self, calibration: str, progress: Progress) -> None:
        """Keep where a running calibration stands.

        Raises
        ------
        CalibrationStateError
            If it is not running.
        """
        now_ns = time.time_ns()
        told = progress.model_dump_json()
        here = (calibrations.c.id == calibration) & (calibrations.c.state == "running")
        with self._database.write() as connection:
            kept = connection.execute(
                update(calibrations).where(here).values(progress=told, updated_utc_ns=now_ns)
            )
            if kept.rowcount != 1:
                raise CalibrationStateError(f"calibration {calibration} does not run")
            _tell(connection, calibration, now_ns, "progress", told)

    def events(
        self, calibration: str, after: int, limit: int = 1_000
    ) -> list[CalibrationEvent]:
        """Return what a calibration told after an event, in order.

        Parameters
        ----------
        calibration : str
            Its id.
        after : int
            Number of the last event that is known; 0: from the beginning.
        limit : int
            At most so many.
        """
        told = calibration_events.c
        query = (
            select(calibration_events)
            .where(told.calibration == calibration, told.number > after)
            .order_by(told.number)
            .limit(limit)
        )
        with self._database.read() as connection:
            rows = connection.execute(query).all()
        return [CalibrationEvent.model_validate(row._mapping) for row in rows]


def _new_id(now_ns: int) -> str:
    # Names a folder, and sorts by time.
    began = time.strftime("%Y%m%d-%H%M%S", time.gmtime(now_ns / 1e9))
    return f"{began}-{secrets.token_hex(4)}"


def _or_busy(connection: Connection, site: str, rig: str, change: Executable) -> int:
    """Make a change; refuse it if it would be a second calibration on one rig."""
    try:
        return int(connection.execute(change).rowcount)
    except IntegrityError as error:
        raise RigBusyError(
            f"a calibration is under way on rig {rig!r} of site {site!r}: wait for its end, or "
            "cancel it"
        ) from error


def _tell(connection: Connection, calibration: str, now_ns: int, kind: str, data: str) -> None:
    # The calibration's row is changed, and so locked, before: numbers have no gaps.
    told = calibration_events.c
    last = select(func.coalesce(func.max(told.number), 0)).where(
        told.calibration == calibration
    )
    connection.execute(
        insert(calibration_events).values(
            calibration=calibration,
            number=connection.execute(last).scalar_one() + 1,
            utc_ns=now_ns,
            kind=kind,
            data=data,
        )
    )


def _get(connection: Connection, calibration: str) -> Calibration:
    row = connection.execute(_ALL.where(calibrations.c.id == calibration)).one_or_none()
    if row is None:
        raise _unknown(calibration)
    return _calibration(row)


def _unknown(calibration: str) -> UnknownCalibrationError:
    return UnknownCalibrationError(f"no calibration {calibration[:80]!r}")


def _calibration(row: Row[Any]) -> Calibration:
    told: dict[str, Any] = dict(row._mapping)
    for field, kind in _DOCUMENTS.items():
        if told[field] is not None:
            told[field] = kind.model_validate_json(told[field])
    published = f"{row.name}@{row.version}" if row.name is not None else None
    return Calibration.model_validate({**told, "published": published})
