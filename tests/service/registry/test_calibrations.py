"""What the registry keeps of calibrations, on either database."""

import json
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from frictus.model import Model
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress
from frictus_service.errors import (
    CalibrationStateError,
    KeyReusedError,
    RegistryUnavailableError,
    RigBusyError,
    UnknownCalibrationError,
)
from frictus_service.jobs.calibrations import HeldCalibrations
from frictus_service.registry.database import Once
from frictus_service.registry.store import Registry, earlier_people

MakeModel = Callable[..., Model]


def spec(rig: str = "rig1", participant: str = "P01") -> CalibrationSpec:
    return CalibrationSpec(rig=rig, participant=participant, seed=7)


def progress(done: int) -> Progress:
    return Progress(
        phase="record", trials_done=done, trials_planned=3, trials_rejected=0, recorded_s=4.0
    )


def create(registry: Registry, **more: str) -> str:
    return registry.calibrations.create(spec(**more), site="lab", by="ann")[0].id


def test_from_queued_to_published(registry: Registry, model: MakeModel) -> None:
    kept = registry.calibrations
    queued, is_new = kept.create(spec(), site="lab", by="ann")
    assert is_new
    assert (queued.state, queued.spec, queued.created_by) == ("queued", spec(), "ann")
    kept.change(queued.id, "running", of=("queued",))
    kept.progress(queued.id, progress(1))
    kept.progress(queued.id, progress(2))
    result = CalibrationResult(
        model=model(), study="s.h5", recorded_s=8.0, precision=0.03, reached=True
    )
    done = kept.change(queued.id, "done", of=("running",), result=result)
    assert (done.progress, done.result, done.published) == (progress(2), result, None)
    published = registry.publish(
        result.model, "rig1/P01", by="ann", rig="rig1", calibration=done.id
    )
    assert published.calibration == done.id
    assert kept.get(done.id).published == "rig1/P01@1"
    again = registry.publish(result.model, "elsewhere", by="ben", calibration=done.id)
    assert again == published

    told = kept.events(done.id, 0)
    assert [event.number for event in told] == [1, 2, 3, 4, 5]
    assert [event.kind for event in told] == ["state"] * 2 + ["progress"] * 2 + ["state"]
    assert [json.loads(told[n].data) for n in (0, 1, 4)] == ["queued", "running", "done"]
    assert Progress.model_validate_json(told[3].data) == progress(2)
    assert kept.events(done.id, 3) == told[3:]
    assert kept.events(done.id, 1, limit=2) == told[1:3]


def test_states_follow_one_another_only_as_they_may(registry: Registry) -> None:
    kept, calibration = registry.calibrations, create(registry)
    with pytest.raises(CalibrationStateError, match="does not run"):
        kept.progress(calibration, progress(1))
    with pytest.raises(CalibrationStateError, match="queued"):
        kept.change(calibration, "cancelled", of=("running",))
    with pytest.raises(UnknownCalibrationError):
        kept.change("0", "cancelled", of=("queued",))
    with pytest.raises(UnknownCalibrationError):
        kept.get("0")
    kept.change(calibration, "cancelled", of=("queued",))
    assert len(kept.events(calibration, 0)) == 2


def test_one_at_a_time_on_a_rig(registry: Registry) -> None:
    kept, first = registry.calibrations, create(registry)
    once = Once.of("key", b"x")
    with pytest.raises(RigBusyError, match="rig1"):
        kept.create(spec(), site="lab", by="ben", once=once)
    create(registry, rig="rig2")
    kept.create(spec(), site="elsewhere", by="ben")
    kept.change(first, "failed", of=("queued",), failure="the rig has tripped")
    second, is_new = kept.create(spec(), site="lab", by="ben", once=once)
    assert is_new
    assert kept.create(spec(), site="lab", by="ben", once=once) == (second, False)
    with pytest.raises(KeyReusedError):
        kept.create(spec(), site="lab", by="ben", once=Once.of("key", b"y"))
    with pytest.raises(RigBusyError):
        kept.change(first, "queued", of=("failed",))  # resumed, while another is under way
    assert kept.get(first).failure == "the rig has tripped"
    kept.change(second.id, "cancelled", of=("queued",))
    assert kept.change(first, "queued", of=("failed",)).failure is None


def test_of_many_that_start_at_once_one_does(registry: Registry) -> None:
    started, refused = [], []

    def start() -> None:
        try:
            started.append(create(registry))
        except RigBusyError:
            refused.append(1)

    threads = [threading.Thread(target=start) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert (len(started), len(refused)) == (1, 5)


def test_where_nothing_ran_nothing_is_written(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    create(registry)
    held = HeldCalibrations(registry.calibrations, tmp_path)
    held.interrupt("lab")

    def write() -> None:
        raise RegistryUnavailableError("attempt to write a readonly database")

    monkeypatch.setattr(registry.database, "write", write)
    assert held.interrupt("lab") == []


def test_what_ran_at_a_site_is_interrupted(registry: Registry, tmp_path: Path) -> None:
    kept = registry.calibrations
    queued, running = create(registry), create(registry, rig="rig2")
    kept.change(running, "running", of=("queued",))
    over = create(registry, rig="rig3")
    kept.change(over, "cancelled", of=("queued",))
    elsewhere = kept.create(spec(), site="elsewhere", by="ben")[0].id
    held = HeldCalibrations(kept, tmp_path)
    assert sorted(held.interrupt("lab")) == sorted([queued, running])
    assert held.interrupt("lab") == []
    states = [kept.get(one).state for one in (queued, running, over, elsewhere)]
    assert states == ["interrupted", "interrupted", "cancelled", "queued"]
    assert json.loads(kept.events(running, 0)[-1].data) == "interrupted"


def test_pages_and_filters(registry: Registry) -> None:
    kept = registry.calibrations
    made = [create(registry, rig=f"rig{n}", participant=f"P{n % 2}") for n in range(5)]
    kept.change(made[3], "cancelled", of=("queued",))
    first = kept.find(limit=3)
    second = kept.find(limit=3, after=first.next or "")
    listed = [one.id for one in [*first.calibrations, *second.calibrations]]
    assert listed == sorted(made, reverse=True)
    assert second.next is None
    assert {one.rig for one in kept.find(participant="P1").calibrations} == {"rig1", "rig3"}
    assert [one.rig for one in kept.find(state="cancelled").calibrations] == ["rig3"]
    assert [one.id for one in kept.find(rig="rig2").calibrations] == [made[2]]


def test_what_was_told_stays(registry: Registry) -> None:
    calibration = create(registry)
    for change in (
        "UPDATE calibration_events SET data = '1'",
        "DELETE FROM calibration_events",
    ):
        with (
            pytest.raises(IntegrityError, match="immutable"),
            registry.database.write() as connection,
        ):
            connection.execute(text(change))
    assert len(registry.calibrations.events(calibration, 0)) == 1


def test_earlier_people_are_learned_from_once_each(
    registry: Registry, model: MakeModel
) -> None:
    for name, gain, person in (
        ("rig1/P01", 0.1, "P01"),
        ("rig1/P01", 0.2, "P01"),
        ("rig2/P01", 0.3, "P01"),
        ("rig1/P02", 0.4, "P02"),
        ("population", 0.5, None),
    ):
        registry.publish(model(gain, person), name, by="ann")
    registry.publish(model(0.6, "P03", covariance=None), "rig1/P03", by="ann")

    def gains(besides: str) -> list[float]:
        return [found.base.gain_n for found in earlier_people(registry, besides)]  # type: ignore[union-attr]

    assert gains("P09") == [0.4, 0.3]
    assert gains("P02") == [0.3]
