"""Activations: which rig was given which published model, and what it confirmed."""

from collections.abc import Callable

from sqlalchemy import insert, select

from frictus_service.registry.database import Database
from frictus_service.registry.documents import Activation, VersionSummary
from frictus_service.registry.names import check_name
from frictus_service.registry.tables import activations


class Activations:
    """The activations of a registry.

    Parameters
    ----------
    database : Database
        Of the registry.
    clock_ns : callable
        UTC, ns.
    """

    def __init__(self, database: Database, clock_ns: Callable[[], int]) -> None:
        self._database = database
        self._clock_ns = clock_ns

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
            activated_utc_ns=self._clock_ns(),
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
        query = select(activations).where(activations.c.name == check_name(name))
        with self._database.read() as connection:
            rows = connection.execute(
                query.order_by(activations.c.id.desc()).limit(limit)
            ).all()
        return [Activation.model_validate(row._mapping) for row in rows]
