"""Alarms name the cause, are rare while the model is right, and wait for no good moment."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.service.tracking.slides import (
    BANDS,
    MOUNT,
    PAPER,
    Deviation,
    Effects,
    Place,
    slide,
    strokes,
)

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_service.calibration.coordinates import Prior, response
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.law_estimate import LawEstimate, advanced, updated
from frictus_service.tracking.evidence import watch as watch_module
from frictus_service.tracking.evidence.naming import NamedAlarm, named_alarms
from frictus_service.tracking.evidence.signatures import LAW_SIZES
from frictus_service.tracking.evidence.watch import (
    ALARM,
    BEGIN_BATCHES,
    CAUSES,
    INSTRUMENT,
    WITHDRAWN,
    ModelWatch,
)


@dataclass(frozen=True)
class Session:
    """The watch over PAPER's law after some batches, and the batch of the first alarm."""

    watch: ModelWatch
    first: int | None

    @property
    def named(self) -> tuple[NamedAlarm, ...]:
        return named_alarms(self.watch)


def session(
    rng: np.random.Generator,
    true: list[FloatArray],
    effects: Effects = (),
    deviation: Deviation | None = None,
    wander: float = 0.0,
    batches_per_contact: int | None = None,
    watch: ModelWatch | None = None,
    path: Iterator[tuple[list[float], list[Place]]] | None = None,
) -> Session:
    """Return a session in which the finger's laws are the given ones, batch by batch."""
    watch, estimate, alarm = (
        watch or ModelWatch.begin(MOUNT),
        LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size),
        None,
    )
    path, contact, gain = path or strokes(rng), 0, 0.0
    for number, at in enumerate(true):
        lifted = bool(batches_per_contact and number % batches_per_contact == 0)
        if lifted:
            contact, gain = contact + 1, 0.10 * rng.standard_normal()
        off = np.array([*np.repeat(wander * rng.standard_normal(), 2), gain, 0.0])
        speeds, places = next(path)
        windows = slide(
            rng,
            at + off,
            speeds,
            contact,
            number * 10_000,
            places=places,
            effects=effects,
            deviation=deviation,
        )
        batch = Batch.of(windows, BANDS)
        known = advanced(estimate, 0.5, new_contact=lifted)
        if known.updates:
            watch = watch.seen(batch, PAPER, known, 0.5, lifted)
        if alarm is None and watch.raised:
            alarm = number
        estimate, _ = updated(known, batch)
    return Session(watch, alarm)


@pytest.mark.parametrize(
    ("off", "cause", "batches"),
    [
        ([0.0, 0.0, 0.45, 0.0], "gain", 50),
        ([0.0, 0.0, -0.6, 0.0], "gain", 40),
        ([0.7, 0.7, 0.0, 0.0], "cutoff", 12),
        ([-0.5, -0.5, 0.0, 0.0], "cutoff", 12),
        ([-0.34, 0.1, 0.0, 0.0], "speed_dependent_cutoff", 12),
        ([0.0, 0.0, 0.0, 60e-6], "delay", 12),
    ],
)
def test_a_wrong_model_is_named(
    off: list[float], cause: str, batches: int, rng: np.random.Generator
) -> None:
    true = [PAPER + np.array(off)] * batches
    found = session(rng, true, batches_per_contact=4)
    assert [alarm.cause for alarm in found.named] == [cause]


@pytest.mark.parametrize(
    ("effect", "dose", "batches"),
    [
        ("speed_dependent_gain", 0.25, 20),
        ("force_dependent_gain", -0.36, 20),
        ("position_dependent_gain", 0.005, 20),
        ("direction_asymmetry", 0.06, 20),
        ("force_dependent_cutoff", 0.25, 20),
        ("fractional_rolloff", 0.25, 20),
        ("charge_leakage", 2.0, 20),
        ("mount_resonance_shift", 0.02, 20),
        ("mains_interference", 0.01, 40),
    ],
)
def test_an_effect_is_named_with_its_size(
    effect: str, dose: float, batches: int, rng: np.random.Generator
) -> None:
    parameter = EFFECTS[effect].parameters[0].name
    found = session(rng, [PAPER] * batches, [(effect, {parameter: dose})])
    assert [alarm.cause for alarm in found.named] == [effect]
    if effect != "mains_interference":
        assert found.named[0].size == pytest.approx(dose, rel=0.3)


def faster_is_more(around: SlidingConditions, frequency_hz: FloatArray) -> ComplexArray:
    inside = (frequency_hz > 320.0) & (frequency_hz < 640.0)
    rises = 0.25 * inside * (around.speed_mm_s - 60.0) / 40.0
    return np.asarray(1.0 + rises, dtype=np.complex128)


def resonance(_: SlidingConditions, frequency_hz: FloatArray) -> ComplexArray:
    off = frequency_hz / 500.0 - 500.0 / frequency_hz
    return np.asarray(1.0 + 0.5 / (1.0 + 8j * off), dtype=np.complex128)


def test_what_no_cause_makes_is_unknown_and_has_a_place(rng: np.random.Generator) -> None:
    alarm = session(rng, [PAPER] * 20, deviation=faster_is_more).named[0]
    assert alarm.cause == "unknown"
    assert alarm.where is not None
    assert (alarm.where.low_hz, alarm.where.covariate) == (320.0, "speed")
    alarms = session(rng, [PAPER] * 20, deviation=resonance).named
    where = next(each.where for each in alarms if each.cause == "unknown")
    assert where is not None
    assert where.low_hz < 600.0
    assert where.high_hz > 400.0


@pytest.mark.long
def test_errors_within_what_is_tolerated_raise_no_alarm(rng: np.random.Generator) -> None:
    gain, cutoff, _, delay = (size.tolerated for size in LAW_SIZES)
    for _ in range(3):
        size = rng.uniform(-0.8, 0.8, 3) * [gain, cutoff, delay]
        at = PAPER + np.array([size[1], size[1], size[0], size[2]])
        found = session(rng, [at] * 30)
        assert found.first is None
        assert np.all(found.watch.log_evidence < ALARM)


@pytest.mark.long
def test_a_right_model_whose_gain_and_cutoff_wander_raises_none(
    rng: np.random.Generator,
) -> None:
    found = session(rng, [PAPER] * 120, wander=0.05, batches_per_contact=8)
    assert found.first is None


def test_a_speed_that_is_told_with_errors_is_no_slope_of_the_cutoff(
    rng: np.random.Generator,
) -> None:
    """Of a finger at one speed what differs in it is error: the cutoff follows none of it."""
    steady_mm_s = 25.0

    def path() -> Iterator[tuple[list[float], list[Place]]]:
        while True:
            for direction in (1.0, -1.0):
                for _ in range(4):
                    told = steady_mm_s + 0.5 * rng.standard_normal(10)
                    yield told.tolist(), [Place(direction=direction)] * 10

    def at_its_speed(around: SlidingConditions, frequency: FloatArray) -> ComplexArray:
        true, told = (
            response(PAPER, speed, frequency)
            for speed in (np.full_like(frequency, steady_mm_s), around.speed_mm_s)
        )
        return np.asarray(true / told, dtype=np.complex128)

    found = session(rng, [PAPER] * 60, deviation=at_its_speed, path=path())
    assert found.watch.raised == ()


def test_a_knock_raises_none(rng: np.random.Generator) -> None:
    def knock(around: SlidingConditions, _: FloatArray) -> ComplexArray:
        struck = rng.random() < 0.01
        noise = rng.standard_normal((2, BANDS.frequency_hz.size)) * struck
        return np.asarray(1.0 + noise[0] + 1j * noise[1], dtype=np.complex128)

    found = session(rng, [PAPER] * 60, deviation=knock)
    assert found.first is None


def test_a_change_late_in_a_session_is_found(rng: np.random.Generator) -> None:
    changed = PAPER + np.array([0.7, 0.7, 0.0, 0.0])
    found = session(rng, [PAPER] * 30 + [changed] * 30)
    assert "cutoff" in found.watch.raised
    assert found.first is not None
    assert found.first >= 30


def test_its_memory_is_bounded(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch_module, "MOST", 3)
    batch = Batch.of(slide(rng, PAPER, [50.0, 60.0]), BANDS)
    estimate, _ = updated(LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size), batch)
    watch = ModelWatch.begin()
    for _ in range(BEGIN_BATCHES * 5):
        watch = watch.seen(batch, PAPER, estimate)
    assert watch.sums.log_share.shape == (3, len(CAUSES))
    assert watch.log_evidence.shape == (len(CAUSES),)
    assert np.all(np.isfinite(watch.log_evidence))
    # All shares that will ever be given sum to one at most.
    assert np.all(np.exp(watch.sums.log_share).sum(axis=0) <= 1.0)


def test_an_alarm_ends_where_what_comes_speaks_against_it(rng: np.random.Generator) -> None:
    """A gain that falls within one stroke follows the position there, and there alone: a rig
    that was named wrong for it was never adapted again."""
    effect = ("position_dependent_gain", {"per_mm": 0.005})
    begun = session(rng, [PAPER] * 8, [effect])
    assert [alarm.cause for alarm in begun.named] == [effect[0]]
    lasting = session(rng, [PAPER] * 60, [effect], watch=begun.watch)
    assert [alarm.cause for alarm in lasting.named] == [effect[0]]
    over = session(rng, [PAPER] * 60, watch=begun.watch)
    assert over.named == ()
    assert over.watch.log_evidence[CAUSES.index(effect[0])] < WITHDRAWN


def test_another_model_ends_the_evidence_on_the_law_only(rng: np.random.Generator) -> None:
    off = PAPER + np.array([0.7, 0.7, 0.0, 0.0])
    found = session(rng, [off] * 15, [("direction_asymmetry", {"share": 0.2})]).watch
    assert {"cutoff", "direction_asymmetry"} <= set(found.raised)
    later = found.of_another_model(0.0)
    evidence = dict(zip(CAUSES, later.log_evidence, strict=True))
    assert (later.raised, evidence["cutoff"]) == ((), 0.0)
    assert evidence["direction_asymmetry"] > ALARM
    # Shares go on: models that follow each other do not have the level once each.
    assert later.begun == found.begun


RIG = [("mount_resonance_shift", {"share": 0.03}), ("channel_delay", {"delay_s": 80e-6})]


def test_what_is_the_rigs_outlasts_the_finger(rng: np.random.Generator) -> None:
    twice = PAPER + np.array([0.7, 0.7, 0.0, 0.0])
    found = session(rng, [twice] * 15, [*RIG, ("direction_asymmetry", {"share": 0.2})]).watch
    of_the_rig = {"mount_resonance_shift", "delay"}
    assert of_the_rig | {"cutoff", "direction_asymmetry"} <= set(found.raised)
    later = found.of_another_finger()
    assert set(later.raised) == INSTRUMENT & set(found.raised)
    assert of_the_rig <= {alarm.cause for alarm in named_alarms(later)}
    before, after = (
        dict(zip(CAUSES, watch.log_evidence, strict=True)) for watch in (found, later)
    )
    for cause in CAUSES:
        assert after[cause] == (before[cause] if cause in INSTRUMENT else 0.0)
    # Shares go on: fingers that follow each other do not have the level once each.
    assert later.begun == found.begun


@pytest.mark.parametrize(("off_s", "stays"), [(10e-6, True), (80e-6, False)])
def test_a_delay_is_the_models_that_tells_it(
    off_s: float, stays: bool, rng: np.random.Generator
) -> None:
    found = session(rng, [PAPER + np.array([0.0, 0.0, 0.0, 80e-6])] * 12).watch
    assert "delay" in found.raised
    later = found.of_another_model(off_s)
    evidence = dict(zip(CAUSES, later.log_evidence, strict=True))
    assert ("delay" in later.raised) is stays
    assert bool(evidence["delay"] >= ALARM) is stays


@pytest.mark.parametrize("delay_s", [0.0, 80e-6])
def test_after_another_finger_only_the_rig_is_judged_by_what_was_seen(
    delay_s: float, rng: np.random.Generator
) -> None:
    """A rig that is right stays so, and the evidence of a wrong one goes on."""
    rig = np.array([0.0, 0.0, 0.0, delay_s])
    before = session(rng, [PAPER + rig] * 12).watch.of_another_finger()
    other = PAPER + rig + np.array([0.5, 0.5, 0.8, 0.0])
    after = session(rng, [other] * 5, watch=before).watch
    assert after.suspected == (("delay",) if delay_s else ())
    place = CAUSES.index("delay")
    gained = after.log_evidence[place] - before.log_evidence[place]
    assert bool(gained > 3.0) is bool(delay_s)


def test_half_of_the_evidence_is_a_suspicion_of_the_rig_or_what_is_like_it() -> None:
    watch = ModelWatch.begin(MOUNT)
    nats = np.full(len(CAUSES), 0.49 * ALARM)
    assert replace(watch, log_evidence=nats).suspected == ()
    suspected = set(replace(watch, log_evidence=nats / 0.97).suspected)
    assert suspected == (INSTRUMENT | {"fractional_rolloff"}) & set(CAUSES)


def test_causes_of_the_rig_are_told_from_those_of_the_finger() -> None:
    assert {
        "delay",
        "channel_delay",
        "mount_resonance_shift",
        "mains_interference",
    } <= INSTRUMENT
    assert not INSTRUMENT & {"gain", "cutoff", "direction_asymmetry", "unknown"}
