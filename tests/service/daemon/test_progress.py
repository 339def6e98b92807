"""A start is given up when nothing moves, not when it takes long."""

import threading
from multiprocessing import Pipe

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

    functions: list[str] = []
    passes: list[None] = []
    with compiling_told(functions.append, lambda: passes.append(None)):
        doubled(1.0)
        doubled(2.0)
    assert functions == ["doubled"]
    assert len(passes) > 10
    doubled(1)  # compiled for another type, after the context
    assert functions == ["doubled"]


def test_a_supervisor_waits_for_a_part_that_moves_and_names_the_one_that_does_not() -> None:
    clock_s = [0.0]
    said: list[str] = []
    supervisor = Supervisor(Config(), ("rig",), say=said.append)
    part = supervisor._parts["rig"]
    part.progress = StartProgress(lambda: clock_s[0])
    part.told, telling = Pipe(duplex=False)
    for clock_s[0] in (50.0, 100.0, 150.0):
        telling.send(("moved", ""))
        supervisor._listen(part)
    telling.send(("step", "compiling mix"))
    supervisor._listen(part)
    assert said == ["rig, 150.0 s: compiling mix"]
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
