"""Workers may die; what they were at may not."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.service.identification.tasks import (
    die_at_minus_one,
    die_first,
    fail,
    square,
    threads,
)

from frictus_service.errors import StudyError
from frictus_service.identification.pipeline.workers import (
    MOST_CRASHES,
    Crash,
    WorkerError,
    work_through,
)
from frictus_service.study.reader import StudyReader

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[4]


def silent(_: str) -> None:
    pass


@pytest.fixture(autouse=True)
def nobody_stays(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.syspath_prepend(ROOT)
    yield
    assert not multiprocessing.active_children()


def test_all_tasks_are_done() -> None:
    done = dict(work_through(square, range(20), 2, silent))
    assert done == {number: number * number for number in range(20)}


def test_no_tasks_need_no_workers() -> None:
    assert list(work_through(square, [], 2, silent)) == []


def test_a_worker_that_dies_loses_nothing(tmp_path: Path) -> None:
    told: list[str] = []
    markers = [tmp_path / str(number) for number in range(3)]
    done = dict(work_through(die_first, markers, 2, told.append))
    assert done == dict.fromkeys(range(3), "done")
    assert sum("died with exit code 9" in line for line in told) == 3


def test_a_task_that_kills_its_workers_is_told() -> None:
    done = dict(work_through(die_at_minus_one, [1, -1, 2], 1, silent))
    assert done == {0: 1, 1: Crash(MOST_CRASHES, "with exit code 7"), 2: 2}


def test_workers_have_one_thread_and_the_parent_keeps_its_own() -> None:
    before = dict(os.environ)
    assert [said for _, said in work_through(threads, [0], 1, silent)] == ["1"]
    assert dict(os.environ) == before


def test_work_that_fails_is_told_with_its_traceback() -> None:
    with pytest.raises(WorkerError, match=r"(?s)Traceback.*no 5"):
        list(work_through(fail, [5], 1, silent))


@pytest.mark.parametrize("content", [None, b"", b"no study"])
def test_a_study_that_cannot_be_read_any_more_is_told_in_words(
    content: bytes | None, tmp_path: Path
) -> None:
    study = tmp_path / "changed.h5"
    if content is not None:
        study.write_bytes(content)
    with pytest.raises(StudyError, match=r"changed\.h5") as refused:
        list(work_through(StudyReader, [study], 1, silent))
    assert "Traceback" not in str(refused.value)


def test_whoever_stops_listening_leaves_no_worker() -> None:
    results = work_through(square, range(100), 2, silent)
    next(results)
    results.close()  # type: ignore[attr-defined]


SCRIPT = """
import sys
from pathlib import Path
sys.path.insert(0, {root!r})
from frictus_service.identification.pipeline.workers import work_through
from tests.service.identification.tasks import work_forever
if __name__ == "__main__":
    list(work_through(work_forever, [Path({folder!r})] * 4, 2, print))
"""


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C is sent by a signal of POSIX")
@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_the_workers_too(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(root=str(ROOT), folder=str(tmp_path)))
    with subprocess.Popen(
        [sys.executable, str(script)], stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as parent:
        try:
            until(lambda: len(list(tmp_path.glob("at-work-*"))) == 2)
            os.killpg(parent.pid, signal.SIGINT)
            _, said = parent.communicate(timeout=30.0)
        finally:
            parent.kill()
    assert "KeyboardInterrupt" in said
    workers = [int(file.name.rpartition("-")[2]) for file in tmp_path.glob("at-work-*")]
    assert len(workers) == 2
    for worker in workers:
        with pytest.raises(ProcessLookupError):
            os.kill(worker, 0)


def until(holds: Callable[[], bool]) -> None:
    give_up = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < give_up
        time.sleep(0.02)
