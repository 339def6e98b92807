"""Simulated trials: what was asked is what is in them, and nothing of the truth."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from frictus_hardware.physics import friction
from frictus_hardware.physics.linear import Mount
from frictus_hardware.simulated.config import WithinPersonScatter
from frictus_laboratory.reproduction.plan import (
    FAULTS,
    StudyConditions,
    TrialPlan,
    log_tones,
    plan_study,
)
from frictus_laboratory.reproduction.population import draw_people
from frictus_laboratory.reproduction.reproduce import record_study, simulate_all
from frictus_laboratory.reproduction.simulate import simulate_trial, study_info
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import Trial

SMALL = StudyConditions(
    (30.0, 300.0, 1000.0), speeds_mm_s=(40.0, 100.0), forces_n=(0.4,), seconds=1.0, span_mm=25.0
)


def plans_of(
    rng: np.random.Generator, design: StudyConditions = SMALL, people: int = 1
) -> list[TrialPlan]:
    return plan_study(draw_people(people, rng), design, rng)


def same(one: Trial, other: Trial) -> bool:
    arrays = [f.name for f in fields(Trial) if isinstance(getattr(one, f.name), np.ndarray)]
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in arrays)


def speed_of(trial: Trial) -> float:
    speed = np.abs(np.gradient(trial.position_mm[:, 0], trial.position_t_s))
    return float(np.median(speed))


def test_every_combination_is_asked_once_of_each_person(rng: np.random.Generator) -> None:
    plans = plans_of(rng, people=2)
    asked = [
        (p.info.participant, p.info.tones_hz, p.info.speed_mm_s, p.info.force_n) for p in plans
    ]
    assert len(set(asked)) == len(asked) == 2 * 3 * 2
    for person in ("P01", "P02"):
        orders = [p.info.order for p in plans if p.info.participant == person]
        assert orders == list(range(6))
    assert log_tones(15)[0] == 30.0
    assert log_tones(15)[-1] == pytest.approx(2000.0)


def test_scatter_has_mean_one_and_its_size(rng: np.random.Generator) -> None:
    scatter = WithinPersonScatter(
        gain_per_trial=0.2, cutoff_per_condition=0.1, skin_per_condition=0.1
    )
    design = replace(SMALL, tones_hz=log_tones(200), scatter=scatter)
    person = draw_people(1, rng)[0]
    plans = plan_study([person], design, rng)
    factors = np.array(
        [
            p.law.gain_n / person.planes["gain_n"].at(p.info.speed_mm_s, p.info.force_n)
            for p in plans
        ]
    )
    assert np.mean(factors) == pytest.approx(1.0, abs=0.06)
    assert np.std(np.log(factors)) == pytest.approx(0.2, rel=0.25)
    assert len({p.law.cutoff_0_hz for p in plans}) == 2  # one per condition


def test_voltage_carries_the_message_at_full_drive(rng: np.random.Generator) -> None:
    for trial in map(simulate_trial, plans_of(rng)):
        assert trial.voltage_v is not None
        drive = 2.0 * np.square(trial.voltage_v / 75.0)
        turned = 2.0 * np.pi * trial.info.tones_hz[0] * np.arange(drive.size) / 20_000
        basis = np.column_stack([np.ones(drive.size), np.cos(turned), np.sin(turned)])
        level, *wave = np.linalg.lstsq(basis, drive)[0]
        assert level == pytest.approx(0.5, abs=2e-3)
        assert np.hypot(*wave) == pytest.approx(0.5, abs=2e-3)


@pytest.mark.parametrize("delay_s", [0.0, 1e-4])
def test_delay_is_that_of_the_plan(rng: np.random.Generator, delay_s: float) -> None:
    tone = 1000.0
    design = replace(SMALL, tones_hz=(tone,), speeds_mm_s=(20.0,), seconds=1.5, delay_s=delay_s)
    plan = replace(plans_of(rng, design)[0], friction_coefficient=0.01)
    trial = simulate_trial(plan)
    assert trial.voltage_v is not None
    first, moving_mm_s = _steadiest(trial)
    rows = slice(first, first + 2000)
    turned = np.exp(-2j * np.pi * tone * np.arange(2000) / 20_000)
    drive = 2.0 * np.square(trial.voltage_v[rows] / 75.0)
    ratio = np.mean(turned * trial.force_n[rows, 0]) / np.mean(turned * drive)
    if np.mean(trial.force_n[rows, 0]) < 0.0:
        ratio = -ratio
    true = friction.frequency_response(plan.law, np.array([tone]), moving_mm_s)[0]
    true *= Mount().lateral.frequency_response(np.array([tone]))[0]
    true *= np.exp(-2j * np.pi * tone * (delay_s + 0.5 / 20_000))  # the hold, and the delay
    assert np.angle(ratio / true) == pytest.approx(0.0, abs=0.06)
    assert abs(ratio / true) == pytest.approx(1.0, abs=0.1)


def _steadiest(trial: Trial) -> tuple[int, float]:
    """Return where 2000 samples of the steadiest motion begin, and its speed."""
    t = trial.position_t_s
    speed = np.abs(np.gradient(trial.position_mm[:, 0], t))
    within = (t > 0.1) & (t < 1.4)
    parts = np.lib.stride_tricks.sliding_window_view(speed[within], 8)
    mean = parts.mean(axis=1)
    spread = np.where(
        mean > 0.5 * np.median(speed[within]), np.ptp(parts, axis=1) / mean, np.inf
    )
    middle = t[within][np.argmin(spread) + 4]
    moving = (t > middle - 0.05) & (t < middle + 0.05)
    return int((middle - 0.05) * 20_000), float(np.mean(speed[moving]))


def test_delay_between_steps_of_the_twin_is_refused(rng: np.random.Generator) -> None:
    with pytest.raises(ValueError, match="whole multiples"):
        simulate_trial(plans_of(rng, replace(SMALL, delay_s=1.3e-5))[0])


def test_finger_follows_its_targets_nearly(rng: np.random.Generator) -> None:
    for trial in map(simulate_trial, plans_of(rng, replace(SMALL, seconds=3.0, span_mm=60.0))):
        assert np.mean(trial.force_n[:, 2]) == pytest.approx(trial.info.force_n, rel=0.15)
        assert speed_of(trial) == pytest.approx(trial.info.speed_mm_s, rel=0.2)
        across = np.mod(trial.position_mm / 0.1 + 1e-6, 1.0)
        assert np.all(across < 1e-5)
        assert np.all(np.diff(trial.position_t_s) == pytest.approx(1.0 / 60.0, abs=6e-5))


def test_faults_show(rng: np.random.Generator) -> None:
    plan = replace(plans_of(rng)[0], fault=None)
    found = {fault: simulate_trial(replace(plan, fault=fault)) for fault in (None, *FAULTS)}
    good = found[None]
    assert np.mean(found["hard"].force_n[:, 2]) > 1.3 * np.mean(good.force_n[:, 2])
    assert speed_of(found["fast"]) > 1.2 * speed_of(good)
    assert np.mean(np.abs(found["lifted"].force_n[:, 2]) < 0.01) > 0.2
    top = found["clipped"].force_n[:, 2].max()
    assert np.mean(found["clipped"].force_n[:, 2] == top) > 0.2
    shares = [p.fault is not None for p in plans_of(rng, replace(SMALL, bad_share=0.5), 40)]
    assert np.mean(shares) == pytest.approx(0.5, abs=0.15)


@pytest.mark.long
def test_study_holds_the_same_whatever_the_workers(
    rng: np.random.Generator, tmp_path: Path
) -> None:
    plans = plans_of(rng)
    told: list[str] = []
    record_study(tmp_path / "study.h5", plans, tell=told.append)
    assert told[-1] == f"{len(plans)} of {len(plans)} trials simulated"
    with StudyReader(tmp_path / "study.h5") as study:
        assert study.excluded == ()
        assert study.info.mount == study_info().mount
        read = [study.read(info.id) for info in study.trials]
    spawned = list(simulate_all(plans, workers=2))
    assert len(read) == len(spawned) == len(plans)
    for stored, simulated, plan in zip(read, spawned, plans, strict=True):
        assert stored.info == simulated.info == plan.info
        assert same(stored, simulated)
