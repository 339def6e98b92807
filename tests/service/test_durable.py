"""Files replaced whole: what is synced when, and that nothing replaces files another way."""

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from tests.full_disk import full_after

from frictus_service.durable import (
    new_folder,
    put_in_free_place,
    remove_left_beside,
    replace_file,
    replace_files,
    scratch_beside,
)

SERVICE = Path(__file__).parents[2] / "service"


def test_content_then_name_then_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "job.json"
    path.write_bytes(b"old")
    done: list[str] = []
    sync, replace = os.fsync, os.replace

    def synced(descriptor: int) -> None:
        whole = os.fstat(descriptor).st_size == 3
        done.append("folder" if os.path.isdir(f"/dev/fd/{descriptor}") else f"file {whole}")
        sync(descriptor)

    def replaced(source: Path, target: Path) -> None:
        done.append("name")
        replace(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    replace_file(path, b"new")
    assert done == ["file True", "name", *(["folder"] if os.name == "posix" else [])]
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def test_files_that_belong_together_are_on_the_disk_before_any_bears_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill between two names left a report beside the document of another, in an eighth."""
    done: list[str] = []
    sync, replace = os.fsync, os.replace

    def synced(descriptor: int) -> None:
        done.append("folder" if os.path.isdir(f"/dev/fd/{descriptor}") else "file")
        sync(descriptor)

    def replaced(source: Path, target: Path) -> None:
        done.append("name")
        replace(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    replace_files({tmp_path / "report.html": b"new", tmp_path / "report.json": b"new"})
    names = ["folder"] if os.name == "posix" else []
    assert done == ["file", "file", "name", "name", *names]


def test_disk_that_refuses_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "job.json"
    path.write_bytes(b"old")

    def refuse(_: int) -> None:
        raise OSError("no room")

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(OSError, match="no room"):
        replace_file(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_files_that_belong_together_are_replaced_once_all_are_written(tmp_path: Path) -> None:
    """A disk that is full at the second left the first beside what belonged to another."""
    paths = [tmp_path / "report.html", tmp_path / "report.json"]
    replace_files(dict.fromkeys(paths, b"old"))
    with pytest.raises(OSError, match="too large"), full_after(1_000):
        replace_files({paths[0]: b"new", paths[1]: bytes(2_000)})
    assert {one: one.read_bytes() for one in tmp_path.iterdir()} == dict.fromkeys(paths, b"old")


@pytest.mark.parametrize("links", [True, False])
def test_a_name_that_is_taken_stays_with_what_bears_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    def no_links(*_: Path) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    if not links:
        monkeypatch.setattr(os, "link", no_links)
    first, second, path = (tmp_path / name for name in ("first", "second", "visit.h5"))
    first.write_bytes(b"first")
    second.write_bytes(b"second")
    put_in_free_place(first, path)
    with pytest.raises(FileExistsError):
        put_in_free_place(second, path)
    assert {one.name: one.read_bytes() for one in tmp_path.iterdir()} == {
        "visit.h5": b"first",
        "second": b"second",
    }


def test_what_a_kill_left_of_a_folder_is_in_nobodys_way(tmp_path: Path) -> None:
    folder = tmp_path / "archive"
    with new_folder(folder) as unfinished:
        (unfinished / "trial").write_bytes(b"half of it")
    folder.rename(unfinished)  # as if it had been killed before
    with new_folder(folder) as again:
        (again / "trial").write_bytes(b"whole")
    assert (folder / "trial").read_bytes() == b"whole"


def test_what_kills_left_of_it_is_removed_after_a_day(tmp_path: Path) -> None:
    folder = tmp_path / "visit[1]"
    left = [tmp_path / f".{folder.name}.0123abc{number}.part" for number in range(3)]
    left[0].mkdir()
    (left[0] / "trial").write_bytes(b"half of it")
    left[1].write_bytes(b"of a file")
    left[2].write_bytes(b"under way")
    own = tmp_path / f".{folder.name}.notes.part"
    own.write_bytes(b"of a person")
    for path in (left[0], left[1], own):
        os.utime(path, (0.0, 0.0))
    with new_folder(folder):
        pass
    assert set(tmp_path.iterdir()) == {folder, left[2], own}


def test_a_folder_that_a_full_disk_does_not_take_is_named(tmp_path: Path) -> None:
    """MATLAB files and Parquet tables ended by an error that named nothing."""
    with (
        pytest.raises(OSError, match=r"No space left.*tables"),
        new_folder(tmp_path / "tables"),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such kill")
def test_what_kills_left_of_a_report_is_removed_after_a_day(tmp_path: Path) -> None:
    """It stayed for ever; reports are of megabytes."""
    report = tmp_path / "report.html"
    code = (
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "from frictus_service import durable\n"
        "os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)\n"
        "durable.replace_file(Path(sys.argv[1]), b'half of it')"
    )
    subprocess.run([sys.executable, "-c", code, report], check=False, timeout=60)
    (left,) = tmp_path.iterdir()
    replace_file(report, b"while it may be under way")
    assert set(tmp_path.iterdir()) == {left, report}
    os.utime(left, (0.0, 0.0))
    replace_file(report, b"a day later")
    assert list(tmp_path.iterdir()) == [report]


def test_what_a_result_is_made_from_goes_with_what_kills_left_of_the_result(
    tmp_path: Path,
) -> None:
    result = tmp_path / "tables"
    with scratch_beside(result) as scratch:
        (scratch / "study.h5").write_bytes(b"all trials")
    assert list(tmp_path.iterdir()) == []
    scratch.mkdir()  # as if it had been killed
    os.utime(scratch, (0.0, 0.0))
    remove_left_beside(result)
    assert list(tmp_path.iterdir()) == []


def test_nothing_replaces_files_another_way() -> None:
    other_ways = re.compile(r"os\.re(?:place|name)\(|\.rename\(|\.replace\(self\.path")
    found = {
        path.relative_to(SERVICE / "frictus_service").as_posix()
        for path in SERVICE.rglob("*.py")
        if other_ways.search(path.read_text(encoding="utf-8"))
    }
    assert found == {
        "durable.py",
        "job_folder.py",  # sets a damaged file aside
    }


def test_a_file_that_is_being_read_is_replaced_after_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Windows refuses to replace a file that is open."""
    path = tmp_path / "texture.json"
    path.write_bytes(b"old")
    replace, reads = os.replace, [1, 2]

    def replaced(source: Path, target: Path) -> None:
        if reads:
            reads.pop()
            raise PermissionError("it is used by another process")
        replace(source, target)

    monkeypatch.setattr(os, "replace", replaced)
    replace_file(path, b"new")
    assert path.read_bytes() == b"new"
    reads += [1] * 1000
    with pytest.raises(PermissionError):
        replace_file(path, b"newer")
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"new"]
