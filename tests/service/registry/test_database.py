"""How a database is opened: settings, migrations, several at once, foreign ones."""

import contextlib
import os
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from frictus.model import Model
from frictus_service.errors import RegistryUnavailableError
from frictus_service.registry import database
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


def test_a_registry_of_before_simulated_models_keeps_what_it_holds(
    url: str, model: MakeModel
) -> None:
    with Registry(url) as registry:
        said = registry.publish(model(), "a", by="ann")
        with registry.database.write() as connection:
            connection.execute(text("ALTER TABLE models DROP COLUMN simulated"))
            connection.execute(text("UPDATE alembic_version SET version_num = '0001'"))
    with Registry(url) as registry:
        assert registry.get("a@1") == said
        assert not said.simulated
        with (
            pytest.raises(IntegrityError, match="immutable"),
            registry.database.write() as connection,
        ):
            connection.execute(text("UPDATE models SET simulated = true"))


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


def test_the_database_of_another_program_is_left_as_it_was(tmp_path: Path) -> None:
    file = tmp_path / "songs.db"
    with contextlib.closing(sqlite3.connect(file)) as songs:
        songs.execute("CREATE TABLE songs (title)")
    with (
        Registry(f"sqlite:///{file}") as registry,
        pytest.raises(RegistryUnavailableError, match=r"another program \(songs\): name a "),
    ):
        registry.find()
    with contextlib.closing(sqlite3.connect(file)) as songs:
        found = songs.execute("SELECT name FROM sqlite_master").fetchall()
    assert found == [("songs",)]


def test_an_empty_file_becomes_a_registry(tmp_path: Path, model: MakeModel) -> None:
    (tmp_path / "x.db").touch()
    with Registry(f"sqlite:///{tmp_path / 'x.db'}") as registry:
        assert registry.publish(model(), "a", by="ann").version == 1


def folder(path: Path) -> None:
    path.mkdir()


def text_file(path: Path) -> None:
    path.write_text("songs")


@pytest.mark.skipif(sys.platform == "win32", reason="no pipes with names there")
@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (folder, r"is a folder: .* such as .*x\.db/frictus\.db"),
        (os.mkfifo, "is a pipe or a device, .* correct registry.url"),
        (text_file, "is not a database of SQLite: correct registry.url"),
    ],
)
def test_what_is_no_database_is_named(
    make: Callable[[Path], None], reason: str, tmp_path: Path
) -> None:
    make(tmp_path / "x.db")
    with (
        Registry(f"sqlite:///{tmp_path / 'x.db'}") as registry,
        pytest.raises(RegistryUnavailableError, match=reason),
    ):
        registry.find()


def test_a_registry_that_lacks_a_table_asks_for_a_backup(tmp_path: Path) -> None:
    file = tmp_path / "x.db"
    with Registry(f"sqlite:///{file}") as registry:
        registry.find()
    with contextlib.closing(sqlite3.connect(file)) as changed:
        changed.execute("DROP TABLE aliases")
    with (
        Registry(f"sqlite:///{file}") as registry,
        pytest.raises(RegistryUnavailableError, match=r"no such table.*put a backup back"),
    ):
        registry.aliases.of("a")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps a file that is open")
def test_a_file_that_is_taken_away_takes_no_models(tmp_path: Path, model: MakeModel) -> None:
    file, elsewhere = tmp_path / "x.db", tmp_path / "elsewhere.db"
    with Registry(f"sqlite:///{file}") as registry:
        registry.publish(model(), "a", by="ann")
        file.rename(elsewhere)
        with pytest.raises(RegistryUnavailableError, match="move the file back"):
            registry.publish(model(), "a", by="ann")
        assert registry.database.exists
        assert not registry.database.usable
        file.write_bytes(elsewhere.read_bytes())  # a copy: what is open is the other one
        with pytest.raises(RegistryUnavailableError, match="move the file back"):
            registry.get("a")
        elsewhere.replace(file)
        assert registry.publish(model(), "a", by="ann").version == 2


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps a file that is open")
def test_beside_one_whose_file_was_deleted_it_is_said_what_to_do(
    tmp_path: Path, model: MakeModel
) -> None:
    file = tmp_path / "x.db"
    open_it = f"""
from frictus_service.errors import RegistryUnavailableError
from frictus_service.registry.store import Registry
try:
    Registry("sqlite:///{file}").find()
except RegistryUnavailableError as error:
    print(error)
"""
    with Registry(f"sqlite:///{file}") as registry:
        registry.publish(model(), "a", by="ann")
        file.unlink()
        told = subprocess.run([sys.executable, "-c", open_it], capture_output=True, text=True)
    assert "end every frictus that uses it, and put back what was taken away" in told.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps a file that is open")
@pytest.mark.parametrize("end", ["-wal", "-shm"])
def test_what_would_go_with_a_kill_is_not_confirmed(
    end: str, tmp_path: Path, model: MakeModel
) -> None:
    file = tmp_path / "x.db"
    with Registry(f"sqlite:///{file}") as registry:
        registry.publish(model(), "a", by="ann")
        Path(f"{file}{end}").unlink()
        with pytest.raises(
            RegistryUnavailableError, match=f"{end} beside its file was deleted"
        ):
            registry.publish(model(), "a", by="ann")
        assert registry.get("a").version == 1
    with Registry(f"sqlite:///{file}") as again:
        assert again.publish(model(), "a", by="ann").version == 2


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows has other rights")
@pytest.mark.parametrize(
    ("what", "told"),
    [
        ("file", "allowed to write the file and its folder"),
        ("folder", "its folder has to be there"),
        ("no folder", "its folder has to be there"),
        ("locked", "end that one, or ask again"),
    ],
)
def test_what_keeps_it_from_being_used_is_said_with_what_helps(
    what: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if what in ("file", "folder") and os.geteuid() == 0:
        pytest.skip("root may write what is read-only")
    monkeypatch.setattr(database, "BUSY_MS", 10)
    folder = tmp_path / "kept"
    url = f"sqlite:///{folder / 'x.db'}"
    folder.mkdir()
    if what in ("file", "locked"):
        with Registry(url) as registry:
            registry.find()
    with contextlib.ExitStack() as held:
        if what == "locked":
            other = held.enter_context(contextlib.closing(sqlite3.connect(folder / "x.db")))
            other.execute("BEGIN IMMEDIATE")
        elif what == "no folder":
            folder.rmdir()
        else:
            (folder / "x.db" if what == "file" else folder).chmod(0o555)
        with Registry(url) as registry:
            assert registry.database.usable == (what == "file")
            with pytest.raises(RegistryUnavailableError, match=told):
                write(registry)


def write(registry: Registry) -> None:
    with registry.database.write() as connection:
        connection.execute(text("UPDATE model_names SET last_version = 1"))


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


@pytest.fixture
def locked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Registry, Any]]:
    """A registry whose file another program holds, and that program's connection."""
    monkeypatch.setattr(database, "BUSY_MS", 100)
    file = tmp_path / "x.db"
    other = sqlite3.connect(file, isolation_level=None, check_same_thread=False)
    other.execute("BEGIN EXCLUSIVE")
    with Registry(f"sqlite:///{file}") as registry:
        yield registry, other
    other.close()


def test_who_waits_for_a_try_to_open_it_that_fails_does_not_try_again(
    locked: tuple[Registry, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    registry, _other = locked
    opening, tries = registry.database._opening, []
    in_line, all_there = threading.Semaphore(0), threading.Event()

    def acquire(blocking: bool) -> bool:
        in_line.release()
        return opening.acquire(blocking)

    def upgrade(_database: object, _engine: object) -> None:
        tries.append(1)
        assert all_there.wait(30.0)
        raise RegistryUnavailableError("held by another program")

    patient = SimpleNamespace(acquire=acquire, release=opening.release)
    monkeypatch.setattr(database.Database, "_upgrade", upgrade)
    with monkeypatch.context() as meanwhile, ThreadPoolExecutor(8) as threads:
        meanwhile.setattr(registry.database, "_opening", patient)
        asked = [threads.submit(registry.find) for _ in range(8)]
        for _ in range(8):
            assert in_line.acquire(timeout=30.0)
        all_there.set()
        for one in asked:
            with pytest.raises(RegistryUnavailableError, match="another program"):
                one.result(30.0)
    assert len(tries) == 1


def test_once_it_failed_one_thread_tries_again_and_nobody_waits_for_it(
    locked: tuple[Registry, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    registry, other = locked
    with pytest.raises(RegistryUnavailableError, match="locked"):
        registry.find()
    trying, go = threading.Event(), threading.Event()
    upgrade = database.Database._upgrade

    def upgrade_later(*given: Any) -> None:
        trying.set()
        assert go.wait(30.0)
        upgrade(*given)

    monkeypatch.setattr(database.Database, "_upgrade", upgrade_later)
    with ThreadPoolExecutor(1) as threads:
        again = threads.submit(registry.find)
        assert trying.wait(30.0)
        assert not registry.database.usable
        other.execute("ROLLBACK")
        go.set()
        assert again.result(30.0).models == []
    assert registry.database.usable


def test_threads_that_find_no_connection_free_do_not_stay(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database, "FREE_S", 0.05)
    with contextlib.ExitStack() as held:
        for _ in range(15):
            held.enter_context(registry.database.read())
        with pytest.raises(RegistryUnavailableError, match="limit"):
            registry.find()
    registry.find()
