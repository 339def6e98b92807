"""Models, aliases, activations and calibrations."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None

SAME = {
    "models": (
        "id = NEW.id OR calibration = NEW.calibration "
        "OR name = NEW.name AND version = NEW.version"
    ),
    "alias_moves": (
        "id = NEW.id OR name = NEW.name AND alias = NEW.alias AND revision = NEW.revision"
    ),
    "activations": "id = NEW.id",
    "calibration_events": "calibration = NEW.calibration AND number = NEW.number",
}
"""Tables whose rows are immutable, and when a new row would take the place of another."""
ACTIVE = "state IN ('queued', 'running')"


def upgrade() -> None:
    """Make the tables and the triggers that keep published rows as they are."""
    _calibrations()
    _models()
    _aliases()
    _activations()
    op.create_table(
        "requests",
        sa.Column("key", sa.Text(), nullable=False),
        sa.Column("fingerprint", sa.Text(), nullable=False),
        sa.Column("made", sa.Text(), nullable=False),
        sa.Column("received_utc_ns", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_requests"),
    )
    if op.get_bind().dialect.name == "sqlite":
        _freeze_on_sqlite()
    else:
        _freeze_on_postgresql()


def _calibrations() -> None:
    op.create_table(
        "calibrations",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("site", sa.Text(), nullable=False),
        sa.Column("rig", sa.Text(), nullable=False),
        sa.Column("participant", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("spec", sa.Text(), nullable=False),
        sa.Column("created_utc_ns", sa.BigInteger(), nullable=False),
        sa.Column("created_by", sa.Text(), nullable=False),
        sa.Column("updated_utc_ns", sa.BigInteger(), nullable=False),
        sa.Column("progress", sa.Text()),
        sa.Column("result", sa.Text()),
        sa.Column("failure", sa.Text()),
        sa.CheckConstraint(
            "state IN ('queued', 'running', 'interrupted', 'cancelled', 'failed', 'done')",
            name=op.f("ck_calibrations_state"),
        ),
        sa.CheckConstraint(
            "(state = 'done') = (result IS NOT NULL)", name=op.f("ck_calibrations_result")
        ),
        sa.CheckConstraint(
            "(state = 'failed') = (failure IS NOT NULL)", name=op.f("ck_calibrations_failure")
        ),
        sa.PrimaryKeyConstraint("id", name="pk_calibrations"),
    )
    op.create_index(
        "one_calibration_per_rig",
        "calibrations",
        ["site", "rig"],
        unique=True,
        sqlite_where=sa.text(ACTIVE),
        postgresql_where=sa.text(ACTIVE),
    )
    op.create_table(
        "calibration_events",
        sa.Column("calibration", sa.Text(), nullable=False),
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("utc_ns", sa.BigInteger(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("data", sa.Text(), nullable=False),
        sa.CheckConstraint(
            "kind IN ('state', 'progress')", name=op.f("ck_calibration_events_kind")
        ),
        sa.ForeignKeyConstraint(
            ["calibration"], ["calibrations.id"], name="fk_calibration_events_calibration"
        ),
        sa.PrimaryKeyConstraint("calibration", "number", name="pk_calibration_events"),
    )


def _models() -> None:
    op.create_table(
        "model_names",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("last_version", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("name", name="pk_model_names"),
    )
    op.create_table(
        "models",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("etag", sa.Text(), nullable=False),
        sa.Column("response", sa.Text(), nullable=False),
        sa.Column("participant", sa.Text()),
        sa.Column("rig", sa.Text()),
        sa.Column("document", sa.Text(), nullable=False),
        sa.Column("published_utc_ns", sa.BigInteger(), nullable=False),
        sa.Column("published_by", sa.Text(), nullable=False),
        sa.Column("comment", sa.Text(), nullable=False),
        sa.Column("calibration", sa.Text()),
        sa.CheckConstraint("version >= 1", name=op.f("ck_models_version")),
        sa.ForeignKeyConstraint(
            ["calibration"], ["calibrations.id"], name="fk_models_calibration"
        ),
        sa.ForeignKeyConstraint(["name"], ["model_names.name"], name="fk_models_name"),
        sa.PrimaryKeyConstraint("id", name="pk_models"),
        sa.UniqueConstraint("calibration", name="uq_models_calibration"),
        sa.UniqueConstraint("name", "version", name="uq_models_name_version"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_models_participant", "models", ["participant"])
    op.create_index("ix_models_rig", "models", ["rig"])


def _aliases() -> None:
    op.create_table(
        "aliases",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("alias", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("moved_utc_ns", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["name", "version"],
            ["models.name", "models.version"],
            name="fk_aliases_name_version",
        ),
        sa.PrimaryKeyConstraint("name", "alias", name="pk_aliases"),
    )
    op.create_table(
        "alias_moves",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("alias", sa.Text(), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("from_version", sa.Integer()),
        sa.Column("to_version", sa.Integer(), nullable=False),
        sa.Column("moved_utc_ns", sa.BigInteger(), nullable=False),
        sa.Column("moved_by", sa.Text(), nullable=False),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["name", "alias"],
            ["aliases.name", "aliases.alias"],
            name="fk_alias_moves_name_alias",
        ),
        sa.PrimaryKeyConstraint("id", name="pk_alias_moves"),
        sa.UniqueConstraint(
            "name", "alias", "revision", name="uq_alias_moves_name_alias_revision"
        ),
        sqlite_autoincrement=True,
    )


def _activations() -> None:
    op.create_table(
        "activations",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("site", sa.Text(), nullable=False),
        sa.Column("rig", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("etag", sa.Text(), nullable=False),
        sa.Column("confirmed", sa.Text(), nullable=False),
        sa.Column("activated_utc_ns", sa.BigInteger(), nullable=False),
        sa.Column("activated_by", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["name", "version"],
            ["models.name", "models.version"],
            name="fk_activations_name_version",
        ),
        sa.PrimaryKeyConstraint("id", name="pk_activations"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_activations_site_rig", "activations", ["site", "rig"])


def _freeze_on_sqlite() -> None:
    for table, same in SAME.items():
        refuse = f"BEGIN SELECT RAISE(ABORT, 'rows of {table} are immutable'); END"
        for change in ("UPDATE", "DELETE"):
            op.execute(
                f"CREATE TRIGGER {table}_no_{change.lower()} BEFORE {change} ON {table} "
                f"{refuse}"
            )
        # INSERT OR REPLACE deletes without asking the triggers above.
        op.execute(
            f"CREATE TRIGGER {table}_no_replace BEFORE INSERT ON {table} "
            f"WHEN EXISTS (SELECT 1 FROM {table} WHERE {same}) {refuse}"
        )


def _freeze_on_postgresql() -> None:
    op.execute(
        "CREATE FUNCTION refuse_change() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
        "RAISE EXCEPTION 'rows of % are immutable', TG_TABLE_NAME "
        "USING ERRCODE = 'integrity_constraint_violation'; END $$"
    )
    for table in SAME:
        op.execute(
            f"CREATE TRIGGER {table}_no_change BEFORE UPDATE OR DELETE ON {table} "
            "FOR EACH ROW EXECUTE FUNCTION refuse_change()"
        )
        op.execute(
            f"CREATE TRIGGER {table}_no_truncate BEFORE TRUNCATE ON {table} "
            "FOR EACH STATEMENT EXECUTE FUNCTION refuse_change()"
        )
