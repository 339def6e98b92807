"""Real-time priority is taken for as many rigs as leave a share of the cores free."""

import os
import threading
from pathlib import Path
from typing import Any

import pytest
import zenoh

import frictus_service.daemon.rig as rig_process
from frictus.session import open_session
from frictus_hardware import SimulatedConfig
from frictus_laboratory.benchmarks.occupancy import _Beats
from frictus_service.config import Config, RouterConfig
from frictus_service.daemon.preparation import (
    RealTimeBudget,
    budget_for,
    raise_priority,
    taken_by_others,
    warm_up,
)
from frictus_service.daemon.rig import run_rig
from frictus_service.processes import (
    CALLS_PRIORITY,
    LOOP_PRIORITY,
    PUBLISHER_PRIORITY,
    free_endpoint,
)
from frictus_service.security.router import open_secured_router

UPTIME_S = 1_000.0


def add_thread(
    proc: Path, pid: int, tid: int, policy: int, began_s: float, used_s: float
) -> None:
    """Write a thread down as Linux does, its name made to be hard to read."""
    ticks = os.sysconf("SC_CLK_TCK")
    fields = ["0"] * 50
    fields[0] = "S"
    fields[11] = str(round(0.75 * used_s * ticks))
    fields[12] = str(round(0.25 * used_s * ticks))
    fields[19] = str(round(began_s * ticks))
    fields[38] = str(policy)
    folder = proc / str(pid) / "task" / str(tid)
    folder.mkdir(parents=True)
    (folder / "stat").write_text(f"{tid} (a ) 1 (name) {' '.join(fields)}\n")


@pytest.fixture
def proc(tmp_path: Path) -> Path:
    (tmp_path / "uptime").write_text(f"{UPTIME_S} 1500.00\n")
    return tmp_path


@pytest.mark.skipif(not hasattr(os, "sched_getscheduler"), reason="no SCHED_FIFO here")
def test_real_time_threads_of_others_count_with_what_they_took(proc: Path) -> None:
    add_thread(proc, 10, 10, 0, 0.0, 900.0)  # a busy one, but not real time
    add_thread(proc, 10, 11, 1, 900.0, 30.0)  # 0.3 of a core
    add_thread(proc, 20, 20, 2, 0.0, 100.0)  # 0.1
    add_thread(proc, 30, 30, 1, UPTIME_S - 0.5, 0.0)  # too young to tell
    add_thread(proc, os.getpid(), 40, 1, 0.0, 500.0)  # this process
    (proc / "50" / "task" / "50").mkdir(parents=True)  # has ended
    (proc / "50" / "task" / "50" / "stat").mkdir()
    assert taken_by_others(0.05, proc) == pytest.approx(0.45)


def test_where_no_threads_are_listed_none_is_known_of(tmp_path: Path) -> None:
    assert taken_by_others(0.05, tmp_path) == 0.0


@pytest.mark.parametrize(
    ("others", "fits"), [(0.0, True), (1.3, True), (1.31, False), (5.0, False)]
)
def test_a_quarter_of_the_cores_stays_free(others: float, fits: bool) -> None:
    assert RealTimeBudget(cores=2, others=others, rig=0.2).fits is fits


def test_what_does_not_fit_is_said_and_takes_no_priority(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda *all: asked.append(all), False)
    monkeypatch.setattr(os, "sched_param", lambda priority: priority, False)
    monkeypatch.setattr(os, "SCHED_FIFO", 1, False)
    told = raise_priority(20, RealTimeBudget(cores=2, others=1.4, rig=0.2))
    assert told.startswith("normal: real-time threads would take 1.60 of 2 cores, 0.20 of them")
    assert "at most 1.50 are accepted" in told
    assert "run fewer rigs" in told
    assert asked == []
    assert raise_priority(20, RealTimeBudget(2, 1.2, 0.2)) == "real time (SCHED_FIFO 20)"
    assert asked == [(0, 1, 20)]


def test_blocks_cost_what_the_warm_up_measured() -> None:
    loop = warm_up(20_000.0, 100)
    assert 1e-3 < loop < 1.0
    assert budget_for(loop).rig > loop


def test_a_rig_that_wants_more_than_the_machine_runs_at_normal_priority() -> None:
    # A hundred times as fast as real time takes several cores.
    config = Config(
        backend=SimulatedConfig(clock=100.0), router=RouterConfig(endpoint=free_endpoint())
    )
    ready, stop, told = threading.Event(), threading.Event(), threading.Event()
    said: list[str] = []

    def say(line: str) -> None:
        said.append(line)
        told.set()

    with open_secured_router(config):
        rig = threading.Thread(target=run_rig, args=(config, _Beats(), ready, stop, None, say))
        rig.start()
        told.wait(60.0)
        ready.wait(60.0)
        stop.set()
        rig.join()
    assert said[0].startswith("loop priority: normal: real-time threads would take")


def test_every_thread_that_takes_the_interpreters_lock_is_real_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Threads begin with the priority of who starts them, Zenoh's too, which call back.
    raised: dict[int, int] = {}
    before_session: list[int] = []

    def note(priority: int, _budget: RealTimeBudget) -> str:
        raised[threading.get_ident()] = priority
        return "noted"

    def open_noted(*given: Any, **options: Any) -> zenoh.Session:
        before_session.append(raised.get(threading.get_ident(), 0))
        return open_session(*given, **options)

    monkeypatch.setattr(rig_process, "raise_priority", note)
    monkeypatch.setattr(rig_process, "open_session", open_noted)
    config = Config(backend=SimulatedConfig(), router=RouterConfig(endpoint=free_endpoint()))
    ready, stop = threading.Event(), threading.Event()
    with open_secured_router(config):
        rig = threading.Thread(target=run_rig, args=(config, _Beats(), ready, stop))
        rig.start()
        assert ready.wait(60.0)
        stop.set()
        rig.join()
    assert before_session == [CALLS_PRIORITY]
    assert sorted(raised.values()) == [CALLS_PRIORITY, PUBLISHER_PRIORITY, LOOP_PRIORITY]
