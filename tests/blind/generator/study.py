"""A study file from a case."""

import json
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from scipy import signal
from tests.blind.generator.case import Case
from tests.blind.generator.faults import FAULTS
from tests.blind.generator.people import Person, Spread, draw_person
from tests.blind.generator.plan import (
    EVERY_S,
    Planned,
    draw_forces,
    draw_speeds,
    draw_tones,
    plan,
)
from tests.blind.generator.recursion import RATE_HZ
from tests.blind.generator.transfer import mount
from tests.blind.generator.trial import CARRIER_HZ, PEAK_V, Contact, Samples, Sensors, run

from frictus_service.study.layout import ConverterStep
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo
from frictus_service.study.writer import StudyWriter

STEPS = {
    "voltage_v": ConverterStep(76.0 / 32767),
    "force_n": ConverterStep(4.0 / 32767),
    "accel_m_s2": ConverterStep(500.0 / 32767),
    "position_mm": ConverterStep(0.1),
}


@dataclass(frozen=True, slots=True)
class Seeds:
    """What the chances of a study are drawn from.

    Attributes
    ----------
    people : int
        People and design: the same again for fresh data of the same truth.
    trials : int
        Order, contacts, noise.
    others : int or None
        Other people, in the same design; None: those that `people` draws.
    """

    people: int
    trials: int
    others: int | None = None


Levels = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]


def make_study(
    path: Path,
    case: Case,
    seeds: Seeds,
    spread: Spread | None = None,
    sensors: Sensors | None = None,
) -> dict[str, Any]:
    """Write a study, and return the truth that the file does not tell.

    Parameters
    ----------
    path : Path
        Of the file to be written.
    case : Case
    seeds : Seeds
    spread, sensors : optional
        The usual ones if not given.

    Returns
    -------
    dict
        What JSON holds: the tones, speeds and forces, and the people.
    """
    design = case.design
    spread, sensors = spread or Spread(), sensors or Sensors()
    levels, people = draw_people(case, seeds, spread)
    rng = np.random.default_rng(seeds.trials)
    of_faults = np.random.default_rng([seeds.trials, 1])
    began = datetime(2026, 1, 1, tzinfo=UTC) + timedelta(hours=int(rng.integers(2000)))
    with StudyWriter(path, study_info()) as writer:
        for person in people:
            began += timedelta(hours=float(rng.uniform(1.0, 30.0)))
            planned = plan(design, *levels, rng)
            contacts = _contacts(planned, spread, rng)
            if design.lifelike:
                contacts = _wandering(contacts, rng)
            for trial, contact in zip(planned, contacts, strict=True):
                samples = run(trial, person, contact, design, sensors, rng)
                asked = _asked(trial, person, began, rng)
                made = _trial(asked, samples, sensors)
                if design.fault:
                    made = FAULTS[design.fault](made, of_faults)
                writer.add(made, STEPS)
    tones_hz, speeds_mm_s, forces_n = levels
    return {
        "tones_hz": tones_hz,
        "speeds_mm_s": speeds_mm_s,
        "forces_n": forces_n,
        "people": [_told(person) for person in people],
    }


def draw_people(case: Case, seeds: Seeds, spread: Spread) -> tuple[Levels, list[Person]]:
    """Return tones in Hz, speeds in mm/s and forces in N of a study, and its people."""
    design = case.design
    rng = np.random.default_rng(seeds.people)
    levels = draw_tones(design, rng), draw_speeds(design, rng), draw_forces(design, rng)
    if seeds.others is not None:
        rng = np.random.default_rng(seeds.others)
    has_slope = design.base == "paper"
    people = [
        draw_person(f"P{number + 1:02d}", case.hidden, spread, has_slope, rng)
        for number in range(design.participants)
    ]
    return levels, people


def study_info() -> StudyInfo:
    """Return what the file says of the rig: the paper's mount."""
    nominal = mount()
    lateral = {
        "numerator": list(nominal.numerator),
        "denominator": list(nominal.denominator),
    }
    return StudyInfo("rig", CARRIER_HZ, PEAK_V, mount_json=json.dumps({"lateral": lateral}))


def _contacts(
    planned: list[Planned], spread: Spread, rng: np.random.Generator
) -> list[Contact]:
    """Return how each trial of a person is unlike the others."""
    conditions = {(trial.speed_mm_s, trial.force_n) for trial in planned}
    of_cutoff = {
        condition: float(np.exp(spread.condition * rng.standard_normal()))
        for condition in sorted(conditions)
    }
    pressing = rng.normal(-0.03, 0.02)
    contacts = []
    for trial in planned:
        gain = float(np.exp(spread.contact * rng.standard_normal()))
        if rng.uniform() < spread.outliers:
            gain *= 2.0 if rng.uniform() < 0.5 else 0.5
        contacts.append(
            Contact(
                gain=gain,
                cutoff=of_cutoff[trial.speed_mm_s, trial.force_n],
                speed=1.5 if rng.uniform() < spread.too_fast else 1.0,
                force=1.0 + pressing * trial.order / len(planned) + 0.02 * rng.normal(),
            )
        )
    return contacts


def _wandering(contacts: list[Contact], rng: np.random.Generator) -> list[Contact]:
    """Return contacts whose gain wanders about a mean, a correlation of 0.93 to the next."""
    changes = 0.05 * rng.standard_normal(len(contacts))
    wandering = np.exp(signal.lfilter([1.0], [1.0, -0.93], changes))
    return [
        replace(contact, gain=contact.gain * float(factor))
        for contact, factor in zip(contacts, wandering, strict=True)
    ]


def _asked(
    planned: Planned, person: Person, began: datetime, rng: np.random.Generator
) -> TrialInfo:
    started = began + timedelta(seconds=EVERY_S * planned.order)
    return TrialInfo(
        id=rng.bytes(6).hex(),
        participant=person.name,
        session=1,
        order=planned.order,
        speed_mm_s=planned.speed_mm_s,
        force_n=planned.force_n,
        tones_hz=planned.tones_hz,
        drive_vpp=2.0 * PEAK_V,
        sample_rate_hz=RATE_HZ,
        started_utc=started.isoformat(),
    )


def _trial(asked: TrialInfo, samples: Samples, sensors: Sensors) -> Trial:
    return Trial(
        info=asked,
        voltage_v=samples.voltage_v,
        force_n=samples.force_n,
        accel_m_s2=samples.accel_m_s2,
        skin_velocity_m_s=None,
        position_mm=samples.position_mm,
        position_t_s=samples.position_t_s,
        force_skew_s=sensors.force_skew_s,
        skin_skew_s=sensors.accel_skew_s,
    )


def _told(person: Person) -> dict[str, float | str]:
    return {
        "name": person.name,
        "gain_n": person.gain_n,
        "cutoff_hz": person.cutoff_hz,
        "slope_hz_per_mm_s": person.slope_hz_per_mm_s,
    }
