"""Commands in processes of their own: what they say, and that they end with the service."""

import sys
import threading
from pathlib import Path

import pytest

from frictus_service.api import own_process
from frictus_service.api.own_process import OwnProcesses
from frictus_service.api.problems import BusyError, InvalidError

FILE = Path("nowhere.mcap")


@pytest.fixture
def sleeper(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Commands that take a minute; set once one of them runs."""
    began = threading.Event()
    begin = OwnProcesses._begun

    def begun(self: OwnProcesses, arguments: tuple[str, ...]) -> object:
        process = begin(self, arguments)
        began.set()
        return process

    monkeypatch.setattr(own_process, "_MAIN", "import time; time.sleep(60.0)")
    monkeypatch.setattr(OwnProcesses, "_begun", begun)
    return began


def test_a_refusal_is_told_in_the_words_of_the_command(tmp_path: Path) -> None:
    file = tmp_path / "nothing.h5"
    with pytest.raises(InvalidError, match="there is no file visit") as told:
        OwnProcesses().run(("study", "show", str(file), "--json"), 60.0, file, "visit.h5")
    assert str(tmp_path) not in str(told.value)


def test_what_takes_too_long_is_ended(sleeper: threading.Event) -> None:
    processes = OwnProcesses()
    with pytest.raises(InvalidError, match=r"takes more than 0\.1 s; use `frictus export`"):
        processes.run(("export",), 0.1, FILE, "a")
    assert processes._running == set()


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_what_says_more_than_memory_holds_is_ended(
    stream: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(own_process, "MOST_BYTES", 100_000)
    endless = f"import sys\nwhile True: sys.{stream}.write('x' * 1_000)"
    monkeypatch.setattr(own_process, "_MAIN", endless)
    with pytest.raises(InvalidError) as told:
        OwnProcesses().run(("export",), 600.0, FILE, "a")
    assert len(str(told.value)) <= own_process.MOST_TOLD


@pytest.mark.skipif(sys.platform != "linux", reason="the system's own choice elsewhere")
def test_what_takes_all_memory_is_ended_before_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_process, "_MAIN", "print(open('/proc/self/oom_score_adj').read())")
    assert OwnProcesses().run(("export",), 60.0, FILE, "a").strip() == b"1000"


def test_what_runs_ends_with_the_service_and_nothing_begins_after(
    sleeper: threading.Event,
) -> None:
    processes, refused = OwnProcesses(), []

    def run() -> None:
        with pytest.raises(BusyError, match="stopping") as told:
            processes.run(("export",), 600.0, FILE, "a")
        refused.append(told)

    asking = threading.Thread(target=run)
    asking.start()
    assert sleeper.wait(30.0)
    processes.close()
    asking.join(30.0)
    assert len(refused) == 1
    run()
    assert processes._running == set()


def test_what_runs_ends_with_a_service_that_is_killed(sleeper: threading.Event) -> None:
    with OwnProcesses()._begun(("export",)) as process:
        assert process.stdin is not None
        process.stdin.close()  # as the system does then
        assert process.wait(30.0) == 1
