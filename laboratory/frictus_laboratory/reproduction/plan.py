"""Which trials a simulated study consists of, and the truth of each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from itertools import product
from typing import Final, Literal

import numpy as np

from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mobility
from frictus_hardware.simulated.config import WithinPersonScatter
from frictus_laboratory.reproduction import paper
from frictus_laboratory.reproduction.population import Person
from frictus_service.study.trial import TrialInfo

Effects = tuple[tuple[str, Mapping[str, float]], ...]
"""Ids of effects, with their parameters."""

Fault = Literal["fast", "hard", "lifted", "clipped"]
FAULTS: Final[tuple[Fault, ...]] = ("fast", "hard", "lifted", "clipped")

SAMPLE_RATE_HZ: Final = 20_000.0
DRIVE_VPP: Final = 150.0
TRIALS_PER_SESSION: Final = 75
TRIAL_EVERY_S: Final = 20.0
BEGAN: Final = datetime(2025, 1, 6, 9, 0, tzinfo=UTC)

LAW_HOLDS_MM_S: Final = (1.0, 200.0)
"""Speeds at which the simulated cutoff follows the law. At a target of 20 or 100 mm/s fingers
go beyond it half of the time; held at the paper's range, the line itself would be bent."""


@dataclass(frozen=True, slots=True)
class StudyConditions:
    """Conditions of a study, and what is wrong with its rig and its people.

    Attributes
    ----------
    tones_hz, speeds_mm_s, forces_n : tuple of float
        Every combination is one trial of each person.
    seconds : float
        Recorded per trial.
    span_mm : float
        Longest stroke.
    bad_share : float
        Of the trials: too fast, too hard, finger lifted, or sensor clipped.
    delay_s : float
        Of the screen's voltage, which nothing declares; a multiple of 12.5 us.
    scatter : WithinPersonScatter
        Within a person, between trials and conditions.
    effects : Effects
        That the rig and every finger have besides.
    """

    tones_hz: tuple[float, ...]
    speeds_mm_s: tuple[float, ...] = paper.SPEEDS_MM_S
    forces_n: tuple[float, ...] = paper.FORCES_N
    seconds: float = 10.0
    span_mm: float = 60.0
    bad_share: float = 0.0
    delay_s: float = 0.0
    scatter: WithinPersonScatter = field(default_factory=WithinPersonScatter)
    effects: Effects = ()


def log_tones(count: int) -> tuple[float, ...]:
    """Return message tones from 30 Hz to 2 kHz, evenly spaced in the logarithm.

    Parameters
    ----------
    count : int
        The paper's is 15.
    """
    return tuple(np.geomspace(30.0, 2000.0, count).tolist())


@dataclass(frozen=True, slots=True)
class TrialPlan:
    """One trial before it is simulated: what is asked, and the truth.

    Attributes
    ----------
    info : TrialInfo
        What was asked of the trial.
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    mobility : Mobility
        Mass, damping and stiffness of the skin.
    friction_coefficient : float
        Of skin on glass, friction over normal force without drive.
    seconds, span_mm, delay_s : float
        As in `StudyConditions`.
    fault : {'fast', 'hard', 'lifted', 'clipped'} or None
    seed : int
        Of everything random in the trial.
    effects : Effects
        As in `StudyConditions`.
    """

    info: TrialInfo
    law: FrictionLaw
    mobility: Mobility
    friction_coefficient: float
    seconds: float
    span_mm: float
    delay_s: float
    fault: Fault | None
    seed: int
    effects: Effects = ()


def plan_study(
    people: Sequence[Person], design: StudyConditions, rng: np.random.Generator
) -> list[TrialPlan]:
    """Return the trials of a study, each person's in random order.

    Parameters
    ----------
    people : sequence of Person
        Drawn people.
    design : StudyConditions
        Tones, speeds, forces and scatter.
    rng : Generator
        Source of everything random.
    """
    return [plan for person in people for plan in _plan_person(person, design, rng)]


def _plan_person(
    person: Person, design: StudyConditions, rng: np.random.Generator
) -> list[TrialPlan]:
    conditions = list(product(design.speeds_mm_s, design.forces_n))
    scatter = design.scatter
    spread = [scatter.cutoff_per_condition, *3 * [scatter.skin_per_condition]]
    shifts = [_about_one(spread, rng) for _ in conditions]
    asked = [(index, tone) for index in range(len(conditions)) for tone in design.tones_hz]
    rng.shuffle(asked)
    return [
        _plan_trial(person, design, order, tone, conditions[index], shifts[index], rng)
        for order, (index, tone) in enumerate(asked)
    ]


def _about_one(spread: Sequence[float], rng: np.random.Generator) -> list[float]:
    """Return lognormal factors of mean one."""
    sigma = np.array(spread)
    factors: list[float] = np.exp(rng.normal(-np.square(sigma) / 2.0, sigma)).tolist()
    return factors


def _plan_trial(
    person: Person,
    design: StudyConditions,
    order: int,
    tone_hz: float,
    condition: tuple[float, float],
    shifts: Sequence[float],
    rng: np.random.Generator,
) -> TrialPlan:
    speed, force = condition
    planes = person.planes
    cutoff, mass, damping, stiffness = shifts
    contact = _about_one([design.scatter.gain_per_trial], rng)[0]
    bad = rng.random() < design.bad_share
    fault = FAULTS[int(rng.integers(len(FAULTS)))]
    return TrialPlan(
        info=_ask(person, order, speed, force, tone_hz),
        law=FrictionLaw(
            gain_n=contact * planes["gain_n"].at(speed, force),
            cutoff_0_hz=cutoff * planes["cutoff_hz"].at(0.0, force),
            slope_hz_per_mm_s=cutoff * planes["cutoff_hz"].per_mm_s,
            speed_range_mm_s=LAW_HOLDS_MM_S,
        ),
        mobility=Mobility(
            mass * planes["mass_kg"].at(speed, force),
            damping * planes["damping_n_s_m"].at(speed, force),
            stiffness * planes["stiffness_n_m"].at(speed, force),
        ),
        friction_coefficient=person.friction_coefficient,
        seconds=design.seconds,
        span_mm=design.span_mm,
        delay_s=design.delay_s,
        fault=fault if bad else None,
        seed=int(rng.integers(2**63)),
        effects=design.effects,
    )


def _ask(person: Person, order: int, speed: float, force: float, tone_hz: float) -> TrialInfo:
    return TrialInfo(
        id=f"{person.name}-{order:04}",
        participant=person.name,
        session=order // TRIALS_PER_SESSION,
        order=order,
        speed_mm_s=speed,
        force_n=force,
        tones_hz=(tone_hz,),
        drive_vpp=DRIVE_VPP,
        sample_rate_hz=SAMPLE_RATE_HZ,
        started_utc=(BEGAN + timedelta(seconds=TRIAL_EVERY_S * order)).isoformat(),
    )
