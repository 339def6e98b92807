"""How a database is opened: settings, migrations, several at once, foreign ones."""

import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import text

from frictus.model import Model
from frictus_service.errors import RegistryUnavailableError
from frictus_service.registry.store import Registry
from frictus_service.registry.tables import metadata

MakeModel = Callable[..., Model]


def test_migrations_make_the_tables_that_the_code_uses(registry: Registry) -> None:
    registry.find()
    with registry.database.read() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, metadata) == []


def test_sqlite_waits_syncs_and_checks(tmp_path: Path) -> None:
    with (
        Registry(f"sqlite:///{tmp_path / 'x.db'}") as registry,
        registry.database.read() as connection,
    ):

        def pragma(name: str) -> object:
            return connection.execute(text(f"PRAGMA {name}")).scalar_one()

        assert pragma("journal_mode") == "wal"
        assert pragma("synchronous") == 2  # FULL
        assert pragma("foreign_keys") == 1
        assert pragma("busy_timeout") == 10_000


def test_a_newer_registry_is_refused(url: str) -> None:
    with Registry(url) as registry:
        registry.find()
        with registry.database.write() as connection:
            connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with (
        Registry(url) as registry,
        pytest.raises(RegistryUnavailableError, match="another version"),
    ):
        registry.find()


def test_a_failed_write_leaves_nothing(registry: Registry, model: MakeModel) -> None:
    registry.publish(model(), "a", by="ann")

    def change_and_fail() -> None:
        with registry.database.write() as connection:
            connection.execute(text("UPDATE model_names SET last_version = 17"))
            raise KeyError("after the change")

    with pytest.raises(KeyError):
        change_and_fail()
    assert registry.publish(model(), "a", by="ann").version == 2


def test_a_file_that_is_no_database_is_told(tmp_path: Path) -> None:
    file = tmp_path / "frictus.db"
    file.write_bytes(b"not a database" * 100)
    with (
        Registry(f"sqlite:///{file}") as registry,
        pytest.raises(RegistryUnavailableError, match="not a database"),
    ):
        registry.find()
    assert file.read_bytes() == b"not a database" * 100


def test_a_reader_is_not_held_up_by_a_writer(tmp_path: Path, model: MakeModel) -> None:
    file = tmp_path / "x.db"
    with Registry(f"sqlite:///{file}") as registry:
        registry.publish(model(), "a", by="ann")
        other = sqlite3.connect(file, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        other.execute("UPDATE model_names SET last_version = 9")
        assert registry.get("a").version == 1
        other.execute("ROLLBACK")
        other.close()
