"""A start is given up when nothing moves, not when it takes long."""

import re
import threading
from multiprocessing import Pipe
from multiprocessing.connection import Connection

import numpy as np
import pytest
from numba import njit

from frictus_service.config import Config
from frictus_service.daemon.processes.child_process import StartProgress, compiling_told
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.errors import StartError


def test_what_moves_may_take_as_long_as_it_likes() -> None:
    clock_s = [0.0]
    progress = StartProgress(lambda: clock_s[0])
    for clock_s[0] in range(1, 1_000, 9):
        assert progress.left_s(10.0) > 0.0
        assert progress.move() == clock_s[0]
    assert progress.step == "starting"


def test_what_stands_still_has_failed_and_says_at_what() -> None:
    clock_s = [0.0]
    progress = StartProgress(lambda: clock_s[0])
    progress.move("compiling mix")
    progress.move()
    clock_s[0] = 10.0
    assert progress.left_s(10.0) == 0.0
    assert progress.step == "compiling mix"
    progress.begin()
    assert progress.left_s(10.0) == 10.0


def test_what_is_compiled_is_told_and_what_is_there_is_not() -> None:
    @njit
    def doubled(x):  # type: ignore[no-untyped-def]
        return 2.0 * x

    @njit
    def arranged(x):  # type: ignore[no-untyped-def]
        return np.repeat(x, 2)  # compiles what Numba has for it

    functions: list[tuple[str, str]] = []
    passes: list[None] = []
    with compiling_told(lambda *told: functions.append(told), lambda: passes.append(None)):
        doubled(1.0)
        doubled(2.0)
        arranged(np.zeros(2))
    assert [name for name, _ in functions] == ["doubled", "arranged"]
    assert re.fullmatch(r"2 of up to \d+ functions", functions[1][1])
    assert len(passes) > 10
    doubled(1)  # compiled for another type, after the context
    assert len(functions) == 2


def starting(said: list[str]) -> tuple[list[float], Supervisor, Connection]:
    """Return a supervisor of a rig that starts, its clock, s, and where the rig tells it."""
    clock_s = [0.0]
    supervisor = Supervisor(Config(), ("rig",), say=said.append)
    part = supervisor._parts["rig"]
    part.progress = StartProgress(lambda: clock_s[0])
    part.told, telling = Pipe(duplex=False)
    return clock_s, supervisor, telling


def test_what_compiles_is_said_now_and_then_and_what_is_begun_at_once() -> None:
    said: list[str] = []
    clock_s, supervisor, telling = starting(said)
    part = supervisor._parts["rig"]

    def tell(at_s: float, what: str, line: str) -> None:
        clock_s[0] = at_s
        telling.send((what, line))
        supervisor._listen(part)

    tell(1.0, "step", "loading")
    tell(2.0, "step", "rendering everything once")
    for half_s in range(5, 25):
        tell(0.5 * half_s, "moved", f"compiling f{half_s}")
        tell(0.5 * half_s, "moved", "")
    assert said == [
        "rig, 1.0 s: loading",
        "rig, 2.0 s: rendering everything once",
        "rig, 7.0 s: compiling f14",
        "rig, 12.0 s: compiling f24",
    ]
    assert part.progress.step == "compiling f24"  # a start that stands still names it
    tell(17.0, "moved", "")  # one function for long: systemd waits for a line, too
    assert said[-1] == "rig, 17.0 s: compiling f24"


def test_a_supervisor_waits_for_a_part_that_moves_and_names_the_one_that_does_not() -> None:
    said: list[str] = []
    clock_s, supervisor, telling = starting(said)
    part = supervisor._parts["rig"]
    for clock_s[0] in (50.0, 100.0, 150.0):
        telling.send(("moved", "compiling mix"))
        supervisor._listen(part)
    assert said[-1] == "rig, 150.0 s: compiling mix"
    waiting = threading.Thread(target=supervisor.wait_ready, args=(60.0,))
    waiting.start()
    part.ready.set()
    with supervisor._changed:
        supervisor._changed.notify_all()
    waiting.join()

    part.ready.clear()
    clock_s[0] = 210.0
    with pytest.raises(StartError, match=r"rig stood still for 60 s while compiling mix"):
        supervisor.wait_ready(60.0)


def test_the_tracker_starts_once_its_rig_is_ready_and_is_not_still_before() -> None:
    clock_s = [0.0]
    supervisor = Supervisor(Config(), ("rig", "tracker"), say=lambda _: None)
    rig, tracker = (supervisor._parts[name] for name in ("rig", "tracker"))
    assert not supervisor._held_back(rig)
    assert supervisor._held_back(tracker)
    for part in (rig, tracker):
        part.progress = StartProgress(lambda: clock_s[0])
    clock_s[0] = 59.0
    rig.progress.move("compiling mix")
    clock_s[0] = 61.0
    waiting = threading.Thread(target=supervisor.wait_ready, args=(60.0,))
    waiting.start()
    rig.ready.set()
    assert not supervisor._held_back(tracker)
    with supervisor._changed:
        supervisor._changed.notify_all()  # it wakes before the tracker has been started
    tracker.ready.set()
    with supervisor._changed:
        supervisor._changed.notify_all()
    waiting.join()

    tracker.ready.clear()
    supervisor.wait_ready(60.0, ("rig", "api"))  # of those that run here, each is ready
    tracker.starts = 1
    with pytest.raises(StartError, match="tracker stood still"):
        supervisor.wait_ready(60.0)
    alone = Supervisor(Config(), ("tracker",), say=lambda _: None)
    assert not alone._held_back(alone._parts["tracker"])
