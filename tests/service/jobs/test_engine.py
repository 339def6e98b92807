"""What holds for every kind of job: how it waits, runs, ends, and is gone on with."""

import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from tests.service.jobs import steps

from frictus.session import open_router
from frictus_service.calibration.job import CalibrationSpec
from frictus_service.config import Config, RegistryConfig, RouterConfig
from frictus_service.discovery.jobs import DiscoverySpec
from frictus_service.errors import (
    CalibrationStateError,
    JobStateError,
    RegistryUnavailableError,
    RigBusyError,
    RigInExperimentError,
    TooManyJobsError,
    UnknownCalibrationError,
    UnknownJobError,
)
from frictus_service.experiments.job import ExperimentSpec
from frictus_service.job_folder import ACTIVE
from frictus_service.jobs import calibrations, discoveries, engine, experiments, process
from frictus_service.jobs.engine import JobEngine, RigUse
from frictus_service.processes import free_endpoint
from frictus_service.registry.store import Registry

ROOT = Path(__file__).parents[3]
WORK = "tests.service.jobs.steps:"
STUDY = "visit.h5"
LOOK_S = 0.01
WRONG_STATE = (JobStateError, CalibrationStateError)
posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGSTOP")


@pytest.fixture(scope="module")
def router() -> Iterator[str]:
    endpoint = free_endpoint()
    with open_router(endpoint):
        yield endpoint


class Calibrating:
    """Calibrations, kept by a registry."""

    def __init__(self, config: Config) -> None:
        self._registry = Registry(config.registry.url)
        self._folder = config.studies

    def engine(self, config: Config) -> JobEngine[Any]:
        return calibrations.CalibrationEngine(
            config, self._registry, RigUse(), WORK + "calibrate"
        )

    def queue(self, engine: Any, number: int, launch: bool = True) -> str:
        spec = CalibrationSpec(rig=f"rig{number}", participant="P01", seed=7)
        if launch:
            return str(engine.start(spec, by="ann", once=None).id)
        return str(engine.store.create(spec, site="lab", by="ann")[0].id)

    def folder(self, engine: Any, job: str) -> Path:
        return self._folder / job

    def close(self) -> None:
        self._registry.close()


class Discovering:
    """Discoveries, kept in folders."""

    def __init__(self, config: Config) -> None:
        config.studies.mkdir(exist_ok=True)
        (config.studies / STUDY).touch()

    def engine(self, config: Config) -> JobEngine[Any]:
        return discoveries.DiscoveryEngine(config, WORK + "discover")

    def queue(self, engine: Any, number: int, launch: bool = True) -> str:
        begin = engine.start if launch else engine.store.create
        return str(begin(DiscoverySpec(study=STUDY, seed=number), by="ann").id)

    def folder(self, engine: Any, job: str) -> Path:
        found: Path = engine.store.folder(job)
        return found

    def close(self) -> None:
        pass


class Experimenting(Discovering):
    """Experiments, kept in folders."""

    def engine(self, config: Config) -> JobEngine[Any]:
        return experiments.ExperimentEngine(config, RigUse(), WORK + "present")

    def queue(self, engine: Any, number: int, launch: bool = True) -> str:
        begin = engine.start if launch else engine.store.create
        spec = ExperimentSpec(rig=f"rig{number}", participant="P01", protocol="detection")
        return str(begin(spec, by="ann").id)


@dataclass
class Service:
    """One service, which can be ended and started again."""

    config: Config
    kind: Any
    engine: Any = field(init=False)

    def __post_init__(self) -> None:
        self.start()

    def start(self) -> None:
        self.engine = self.kind.engine(self.config)

    def begin(self, number: int = 1) -> str:
        return str(self.kind.queue(self.engine, number))

    def folder(self, job: str) -> Path:
        found: Path = self.kind.folder(self.engine, job)
        return found

    def allow(self, job: str) -> None:
        self.folder(job).mkdir(parents=True, exist_ok=True)
        (self.folder(job) / steps.GO).touch()

    def starts(self, job: str) -> list[str]:
        path = self.folder(job) / steps.STARTS
        return path.read_text("ascii").split() if path.exists() else []

    def wait_for_start(self, job: str, count: int = 1) -> None:
        while len(self.starts(job)) < count:
            assert self.engine.get(job).state in ACTIVE, self.engine.get(job)
            time.sleep(LOOK_S)

    def end_of(self, job: str) -> str:
        while (found := self.engine.get(job)).state in ACTIVE:
            time.sleep(LOOK_S)
        return str(found.state)

    def process_of(self, job: str) -> process.JobProcess:
        running: process.JobProcess | None = self.engine._jobs[job].process
        assert running is not None
        return running

    def states(self, job: str) -> list[str]:
        told = self.engine.store.events(job, 0)
        return [json.loads(event.data) for event in told if event.kind == "state"]


@pytest.fixture(params=[Calibrating, Discovering, Experimenting])
def service(
    request: pytest.FixtureRequest,
    router: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[Service]:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    config = Config(
        site="lab",
        studies=tmp_path / "studies",
        registry=RegistryConfig(url=f"sqlite:///{tmp_path / 'registry.db'}"),
        router=RouterConfig(endpoint=router, host=False),
    )
    kind = request.param(config)
    found = Service(config, kind)
    yield found
    found.engine.close()
    kind.close()


@pytest.fixture
def one_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    for kind in (calibrations, experiments):
        monkeypatch.setattr(kind, "AT_ONCE", 1)


@pytest.mark.usefixtures("one_at_a_time")
def test_one_that_waits_is_cancelled_at_once(service: Service) -> None:
    service.engine.close()
    service.start()  # with one turn
    first = service.begin(1)
    service.wait_for_start(first)
    second, third = service.begin(2), service.begin(3)
    assert service.engine.get(second).state == "queued"
    assert service.engine.cancel(second).state == "cancelled"
    with pytest.raises(WRONG_STATE, match="is cancelled"):
        service.engine.cancel(second)
    for job in (first, third):
        service.allow(job)
        assert service.end_of(job) == "done"
    assert service.starts(second) == []


def test_one_that_runs_is_cancelled_once_it_has_ended(service: Service) -> None:
    job = service.begin()
    service.wait_for_start(job)
    assert service.engine.cancel(job).state in ("running", "cancelled")
    assert service.end_of(job) == "cancelled"
    with pytest.raises(WRONG_STATE, match="is cancelled"):
        service.engine.cancel(job)
    with pytest.raises((UnknownJobError, UnknownCalibrationError)):
        service.engine.cancel("0-0")


@pytest.mark.parametrize("service", [Discovering], indirect=True)
def test_discoveries_that_wait_are_bounded_of_one_person_and_of_all(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(discoveries, "MOST", 4)
    spec = DiscoverySpec(study=STUDY, seed=1)
    first, second = (service.engine.start(spec, by="ann").id for _ in range(2))
    with pytest.raises(TooManyJobsError, match="2 of them yours; accepted: 4, and 2 of one"):
        service.engine.start(spec, by="ann")
    service.engine.start(spec, by="bob")
    service.engine.start(spec, by="eve")
    with pytest.raises(TooManyJobsError, match="4 discoveries run or wait"):
        service.engine.start(spec, by="joe")
    assert len(service.engine.store.all()) == 4
    service.engine.cancel(second)
    service.engine.start(spec, by="joe")
    service.allow(first)
    assert service.end_of(first) == "done"


def test_one_that_has_just_ended_is_not_cancelled(service: Service) -> None:
    job = service.begin()
    service.wait_for_start(job)
    change, told = service.engine.store.change, []

    def cancel() -> None:
        with pytest.raises(WRONG_STATE, match="is done"):
            service.engine.cancel(job)
        told.append(True)

    asking = threading.Thread(target=cancel)

    def keep(job: str, to: str, **given: Any) -> Any:
        kept = change(job, to, **given)
        asking.start()  # between what is kept of it and its being taken off
        asking.join(0.3)
        return kept

    service.engine.store.change = keep
    service.allow(job)
    assert service.end_of(job) == "done"
    while not asking.ident:
        time.sleep(LOOK_S)
    asking.join()
    assert told


def test_killed_it_is_interrupted_and_can_be_gone_on_with(service: Service) -> None:
    job = service.begin()
    service.wait_for_start(job)
    service.process_of(job)._process.kill()
    assert service.end_of(job) == "interrupted"
    if not service.engine.resumable:
        with pytest.raises(WRONG_STATE, match="is interrupted"):
            service.engine.resume(job)
        return
    assert service.engine.resume(job).state == "queued"
    service.wait_for_start(job, 2)
    service.allow(job)
    assert service.end_of(job) == "done"
    with pytest.raises(WRONG_STATE, match="is done"):
        service.engine.resume(job)
    assert len(set(service.starts(job))) == 2  # each in a process of its own


def test_a_service_that_ends_interrupts_and_the_next_takes_over(service: Service) -> None:
    ended = service.begin(1)
    service.wait_for_start(ended)
    service.engine.close()
    assert service.engine.get(ended).state == "interrupted"
    lost = service.kind.queue(service.engine, 2, launch=False)  # by one that was killed
    service.start()
    assert service.engine.get(lost).state == "interrupted"
    assert service.engine.get(ended).state == "interrupted"
    if service.engine.resumable:
        service.allow(ended)
        service.engine.resume(ended)
        assert service.end_of(ended) == "done"


def test_events_go_on_behind_the_last_one_that_is_known(service: Service) -> None:
    job = service.begin()
    service.wait_for_start(job)
    service.allow(job)
    assert service.end_of(job) == "done"
    if isinstance(service.kind, Experimenting):
        # Their stream tells what they show now, not what they showed.
        assert service.engine.changes >= 4  # queued, running, a screen, done
        assert service.engine.get(job).screen is None
        return
    told = service.engine.store.events(job, 0)
    assert [event.number for event in told] == list(range(1, len(told) + 1))
    assert [event.kind for event in told] == ["state", "state", "progress", "state"]
    assert service.states(job) == ["queued", "running", "done"]
    for after in range(len(told) + 1):
        assert service.engine.store.events(job, after) == told[after:]
    service.engine.close()
    service.start()
    assert service.engine.store.events(job, 2) == told[2:]


@posix
def test_one_that_is_stuck_holds_nobody_up(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "GRACE_S", 0.1)
    stuck = service.begin(1)
    service.wait_for_start(stuck)
    os.kill(service.process_of(stuck).pid, signal.SIGSTOP)
    other = service.begin(2)
    service.allow(other)
    if not isinstance(service.engine, discoveries.DiscoveryEngine):
        assert service.end_of(other) == "done"  # while the first is stuck
    assert service.engine.get(stuck).state == "running"
    service.engine.cancel(stuck)
    assert service.end_of(stuck) == "cancelled"
    assert service.end_of(other) == "done"


@posix
def test_work_that_is_not_taken_holds_up_nobody_who_cancels(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(process, "GRACE_S", 0.1)
    spec = DiscoverySpec(study=STUDY)
    work = discoveries.DiscoveryWork(
        run="x" * 2_000_000, folder=tmp_path, spec=spec, studies=(tmp_path,)
    )  # more than any pipe holds
    job = process.JobProcess(work)
    os.kill(job.pid, signal.SIGSTOP)

    def run() -> None:
        with job:
            assert list(job.said()) == []

    giving = threading.Thread(target=run)
    giving.start()
    stops: list[Callable[[], None]] = [job.stop, job.stop]
    for stop in stops:
        stop()
    giving.join(60.0)
    assert not giving.is_alive()
    assert job._process.returncode == -signal.SIGKILL


def test_what_became_of_one_is_kept_once_it_can_be(
    service: Service, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(engine, "AGAIN_S", LOOK_S)
    tried, kept, keep = threading.Semaphore(0), threading.Event(), service.engine.store.change

    def change(job: str, to: Any, **given: Any) -> Any:
        if to == "done" and not kept.is_set():
            tried.release()
            raise RegistryUnavailableError("away") if registered else OSError(28, "disk full")
        return keep(job, to, **given)

    registered = isinstance(service.kind, Calibrating)
    monkeypatch.setattr(service.engine.store, "change", change)
    job = service.begin()
    service.allow(job)
    for _ in range(3):
        assert tried.acquire(timeout=60.0)
    assert service.engine.get(job).state == "running"
    kept.set()
    assert service.end_of(job) == "done"
    assert caplog.text.count("its state is not kept yet") == 1


def test_progress_that_cannot_be_kept_ends_nothing(
    service: Service, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def progress(*_: Any) -> None:
        raise OSError(28, "disk full")

    if isinstance(service.kind, Experimenting):
        return  # their screens are not kept
    monkeypatch.setattr(service.engine.store, "progress", progress)
    job = service.begin()
    service.allow(job)
    assert service.end_of(job) == "done"
    assert "progress was not kept" in caplog.text


def test_one_whose_start_cannot_be_kept_does_not_stand_there_as_queued(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep = service.engine.store.change

    def change(job: str, to: Any, **given: Any) -> Any:
        if to == "running":
            raise OSError(28, "disk full")
        return keep(job, to, **given)

    monkeypatch.setattr(service.engine.store, "change", change)
    assert service.end_of(service.begin()) == "interrupted"


def test_nobody_cancels_one_between_its_queue_and_its_launch(
    service: Service, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    # It would be cancelled in the store, launched all the same, and end with a traceback.
    if not service.engine.resumable:
        pytest.skip("none is resumed")
    job = service.begin()
    service.wait_for_start(job)
    service.process_of(job)._process.kill()
    assert service.end_of(job) == "interrupted"
    keep, cancelling = service.engine.store.change, threading.Thread()

    def change(job: str, to: Any, **given: Any) -> Any:
        nonlocal cancelling
        found = keep(job, to, **given)
        if to == "queued":
            cancelling = threading.Thread(target=service.engine.cancel, args=(job,))
            cancelling.start()
            cancelling.join(0.2)  # as far as it comes
        return found

    monkeypatch.setattr(service.engine.store, "change", change)
    service.engine.resume(job)
    cancelling.join()
    assert service.end_of(job) == "cancelled"
    service.engine.close()
    assert "Traceback" not in caplog.text


@pytest.fixture
def both(service: Service, tmp_path: Path) -> Iterator[tuple[Service, Service]]:
    """Calibrations, and experiments on the same rigs."""
    if not isinstance(service.kind, Calibrating):
        pytest.skip("once")
    use = service.engine._use
    other = Service(service.config, Experimenting(service.config))
    other.engine = experiments.ExperimentEngine(service.config, use, WORK + "present")
    yield service, other
    other.engine.close()


def test_a_rig_has_one_job_at_a_time_of_whatever_kind(both: tuple[Service, Service]) -> None:
    calibrating, experimenting = both
    for first, second, busy in (
        (calibrating, experimenting, RigBusyError),
        (experimenting, calibrating, RigInExperimentError),
    ):
        left = second.begin()
        second.wait_for_start(left)
        second.process_of(left)._process.kill()
        assert second.end_of(left) == "interrupted"
        job = first.begin()
        with pytest.raises(busy, match="under way"):
            second.begin()
        with pytest.raises(busy, match="under way"):
            second.engine.resume(left)
        first.allow(job)
        assert first.end_of(job) == "done"


def test_two_that_ask_for_one_rig_at_once_are_asked_in_turn(
    both: tuple[Service, Service], monkeypatch: pytest.MonkeyPatch
) -> None:
    calibrating, experimenting = both
    create, refused = experimenting.engine.store.create, list[Exception]()

    def begin() -> None:
        try:
            calibrating.begin()
        except RigInExperimentError as error:
            refused.append(error)

    asking = threading.Thread(target=begin)

    def create_meanwhile(*given: Any) -> Any:
        asking.start()
        asking.join(0.2)  # as far as it comes
        return create(*given)

    monkeypatch.setattr(experimenting.engine.store, "create", create_meanwhile)
    experimenting.begin()
    asking.join()
    assert len(refused) == 1
