"""The tables; `migrations/` makes them, with triggers that keep published rows as they are.

Documents are kept as the JSON text that was published, times as UTC nanoseconds. Rows of
models, alias moves, activations and events are never changed or deleted, whoever is connected
to the database.
"""

from typing import Final

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    Integer,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
    false,
)

metadata: Final = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s",
        "pk": "pk_%(table_name)s",
    }
)

calibrations: Final = Table(
    "calibrations",
    metadata,
    Column("id", Text, primary_key=True),
    Column("site", Text, nullable=False),
    Column("rig", Text, nullable=False),
    Column("participant", Text, nullable=False),
    Column("state", Text, nullable=False),
    Column("spec", Text, nullable=False),
    Column("created_utc_ns", BigInteger, nullable=False),
    Column("created_by", Text, nullable=False),
    Column("updated_utc_ns", BigInteger, nullable=False),
    Column("progress", Text),
    Column("result", Text),
    Column("failure", Text),
    CheckConstraint(
        "state IN ('queued', 'running', 'interrupted', 'cancelled', 'failed', 'done')", "state"
    ),
    CheckConstraint("(state = 'done') = (result IS NOT NULL)", "result"),
    CheckConstraint("(state = 'failed') = (failure IS NOT NULL)", "failure"),
)
_ACTIVE: Final = calibrations.c.state.in_(["queued", "running"])
Index(
    "one_calibration_per_rig",
    calibrations.c.site,
    calibrations.c.rig,
    unique=True,
    sqlite_where=_ACTIVE,
    postgresql_where=_ACTIVE,
)

calibration_events: Final = Table(
    "calibration_events",
    metadata,
    Column("calibration", ForeignKey(calibrations.c.id), primary_key=True),
    Column("number", Integer, primary_key=True, autoincrement=False),
    Column("utc_ns", BigInteger, nullable=False),
    Column("kind", Text, nullable=False),
    Column("data", Text, nullable=False),
    CheckConstraint("kind IN ('state', 'progress')", "kind"),
)

model_names: Final = Table(
    "model_names",
    metadata,
    Column("name", Text, primary_key=True),
    Column("last_version", Integer, nullable=False),
)

models: Final = Table(
    "models",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("name", ForeignKey(model_names.c.name), nullable=False),
    Column("version", Integer, nullable=False),
    Column("etag", Text, nullable=False),
    Column("response", Text, nullable=False),
    Column("participant", Text, index=True),
    Column("rig", Text, index=True),
    Column("document", Text, nullable=False),
    Column("published_utc_ns", BigInteger, nullable=False),
    Column("published_by", Text, nullable=False),
    Column("comment", Text, nullable=False),
    Column("calibration", ForeignKey(calibrations.c.id), unique=True),
    Column("simulated", Boolean, nullable=False, server_default=false()),
    UniqueConstraint("name", "version"),
    CheckConstraint("version >= 1", "version"),
    sqlite_autoincrement=True,
)

aliases: Final = Table(
    "aliases",
    metadata,
    Column("name", Text, primary_key=True),
    Column("alias", Text, primary_key=True),
    Column("version", Integer, nullable=False),
    Column("revision", Integer, nullable=False),
    Column("moved_utc_ns", BigInteger, nullable=False),
    ForeignKeyConstraint(["name", "version"], [models.c.name, models.c.version]),
)

alias_moves: Final = Table(
    "alias_moves",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("name", Text, nullable=False),
    Column("alias", Text, nullable=False),
    Column("revision", Integer, nullable=False),
    Column("from_version", Integer),
    Column("to_version", Integer, nullable=False),
    Column("moved_utc_ns", BigInteger, nullable=False),
    Column("moved_by", Text, nullable=False),
    Column("reason", Text, nullable=False),
    ForeignKeyConstraint(["name", "alias"], [aliases.c.name, aliases.c.alias]),
    UniqueConstraint("name", "alias", "revision"),
    sqlite_autoincrement=True,
)

activations: Final = Table(
    "activations",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("site", Text, nullable=False),
    Column("rig", Text, nullable=False),
    Column("name", Text, nullable=False),
    Column("version", Integer, nullable=False),
    Column("etag", Text, nullable=False),
    Column("confirmed", Text, nullable=False),
    Column("activated_utc_ns", BigInteger, nullable=False),
    Column("activated_by", Text, nullable=False),
    ForeignKeyConstraint(["name", "version"], [models.c.name, models.c.version]),
    Index("ix_activations_site_rig", "site", "rig"),
    sqlite_autoincrement=True,
)

requests: Final = Table(
    "requests",
    metadata,
    Column("key", Text, primary_key=True),
    Column("fingerprint", Text, nullable=False),
    Column("made", Text, nullable=False),
    Column("received_utc_ns", BigInteger, nullable=False),
)
