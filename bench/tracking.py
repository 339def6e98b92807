"""Measure how the finger is followed while it plays: `python bench/tracking.py --help`.

Simulated people on the twin, free strokes over shipped textures that a placeholder model
renders: how soon the estimate renders as the true law would, whether its intervals hold, and
how soon an alarm names what is wrong. The seed is fresh each time, and in the document.
"""

import argparse
import secrets
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path as File
from typing import Final

import numpy as np

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus.recordings import texture_of
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.stages import FrictionResponse, SensorNoise
from frictus_hardware.physics.twin import Twin
from frictus_hardware.simulated.config import (
    Participant,
    ParticipantEffect,
    SimulatedConfig,
    draw_participant,
)
from frictus_hardware.simulated.human import HumanStrokes
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.fidelity.measure import feel, full_gain
from frictus_service.fidelity.path import walk
from frictus_service.fidelity.preview import NOMINAL_HZ
from frictus_service.library import SHIPPED
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.tracking.tracker import ModelInForce, Tracker
from frictus_service.tracking.windows import WindowCutter

OUT: Final = File(__file__).parents[1] / "docs" / "live_model.md"
RATE_HZ: Final = 20_000.0
PART: Final = 2_000
SPEEDS_MM_S: Final = np.array([20.0, 40.0, 60.0, 80.0, 100.0])
WITHIN_DB: Final = 0.1
FACTORS: Final = (0.5, 1.0, 2.0)
"""Of the population's cutoff."""
CAUSES: Final = {
    "gain, 1.5 times": {"gain_n": 1.5},
    "cutoff, half": {"cutoff_0_hz": 0.5, "slope_hz_per_mm_s": 0.5},
    "cutoff, twice": {"cutoff_0_hz": 2.0, "slope_hz_per_mm_s": 2.0},
    "delay, 100 us": {},
    "nothing": {},
}
EFFECTS: Final = {
    "charge_leakage": {"corner_hz": 2.0},
    "direction_asymmetry": {"share": 0.06},
    "fractional_rolloff": {"excess_order": 0.24},
    "force_dependent_cutoff": {"exponent": 0.18},
    "force_dependent_gain": {"exponent": 0.18},
    "mains_interference": {"amplitude_n": 0.004},
    "mount_resonance_shift": {"share": 0.05},
    "position_dependent_gain": {"per_mm": 0.005},
    "speed_dependent_cutoff": {"slope_hz_per_mm_s": 4.8},
    "speed_dependent_gain": {"exponent": 0.25},
}
"""Twice the smallest size that a study finds; of leakage and roll-off twice, and of the mount
ten times that. Drifts need a session that lasts, and what is not here is not seen live."""


@dataclass(frozen=True, slots=True)
class Course:
    """How one session went; arrays of one entry per update.

    Attributes
    ----------
    at_s : ndarray
        Of each update, since the session began.
    error_db : ndarray
        Of a rendering that undoes the estimate.
    covered : ndarray of bool, shape (4,)
        Which coordinates lie in their intervals at the end.
    named : dict of str to float
        Causes with an alarm, and when it rose, s.
    alarms : tuple of str
        At the end.
    """

    at_s: FloatArray
    error_db: FloatArray
    covered: np.ndarray[tuple[int], np.dtype[np.bool_]]
    named: dict[str, float]
    alarms: tuple[str, ...]


def error_db(at: FloatArray, true: FloatArray) -> float:
    """Return the error of a rendering that undoes a law which is not the true one, dB rms."""
    frequency = np.array(NOMINAL_HZ)
    ratio = 0.0
    for one, sign in ((true, 1.0), (at, -1.0)):
        cutoff = coordinates.cutoff_hz(one, SPEEDS_MM_S)[:, np.newaxis]
        size = np.exp(one[2]) * cutoff / np.hypot(cutoff, frequency)
        ratio = ratio + sign * 20.0 * np.log10(size)
    return float(np.sqrt(np.mean(np.square(ratio))))


def session(
    texture: str, person: Participant, delay_s: float, seconds: float, seed: int
) -> Course:
    """Return the course of one session: the placeholder renders, nothing is adapted."""
    config = SimulatedConfig(seed=seed, finger=HumanStrokes(), participant=person)
    path = walk(config, seconds)
    scene = full_gain(
        texture_of((SHIPPED / f"{texture}.json").read_text(encoding="utf-8")),
        FrictionLaw(),
        config.screen,
        RATE_HZ,
    )
    sensors = (SensorNoise(0.002, 0.05, seed),)
    twin = person.simulator.twin(config.screen, person.friction_coefficient, sensors, seed=seed)
    late = tuple(
        replace(stage, delay_s=stage.delay_s + delay_s)
        if isinstance(stage, FrictionResponse)
        else stage
        for stage in twin.stages
    )
    signals, _ = feel(path, scene, FrictionLaw(), config.screen, Twin(late))
    law = person.law
    true = coordinates.from_law(law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, delay_s)
    tracker = Tracker(
        WindowCutter(RATE_HZ, config.screen.peak_v, Mount().lateral), Prior.weak()
    )
    tracker.put_in_force(ModelInForce.of("placeholder", placeholder_model()))
    at_s, errors, named = [], [], dict[str, float]()
    speed = np.hypot(*signals.velocity_mm_s.T)
    render = np.vstack([signals.position_mm.T, speed])
    for first in range(0, speed.size, PART):
        cut = slice(first, first + PART)
        data = {
            "force": signals.force_n[cut].T,
            "voltage": signals.voltage_v[np.newaxis, cut],
            "render": render[:, cut],
        }
        held = {name: rows.astype(np.float32) for name, rows in data.items()}
        if tracker.take(AlignedSamples(1, first, 0, RATE_HZ, 0, Flag(0), held)):
            at_s.append((first + PART) / RATE_HZ)
            errors.append(error_db(tracker.estimate.mean, true))
            for cause in tracker.state(0).alarms:
                named.setdefault(cause, at_s[-1])
    estimate = tracker.estimate
    covered = np.abs(estimate.mean - true) < estimate.half_width
    alarms = tracker.state(0).alarms
    return Course(np.array(at_s), np.array(errors), covered, named, alarms)


TEXT: Final = """# The model while it plays

Made by `uv run python bench/tracking.py`, on the twin: people drawn from the population of
the simulated participants, free strokes, shipped textures rendered by the placeholder model,
sensors with noise. `frictus track` does the same on a rig or with a recording. Nothing was
measured on a real finger. The rig's model is not changed meanwhile: adapting it while it plays
is not built.

## How soon it renders as the true law would
{sessions} sessions of {seconds:g} s, people drawn at random at 0.5, 1 and 2 times their cutoff.
*Begins at*: error of a rendering by the placeholder, dB rms over third octaves at 20 to 100
mm/s. *Within {within:g} dB*: seconds of free strokes, turns and pauses included, after which
the error of the estimate stays below it.

| texture | begins at, dB | within {within:g} dB, median (90 %) | at the end, median (worst) |
|---|---|---|---|
{rows}

Of the 95 % intervals at the end, those hold: {covered}.

## How soon it says what is wrong
{each} sessions of {seconds:g} s each with the placeholder in force and one thing different. An
alarm has a chance of 1 % in a session whose model is right within 15 % of gain, 10 % of cutoff
and 15 us of delay.

| different | named | median time, s | anything else named |
|---|---|---|---|
{alarms}

## How soon it names what the law does not have
{effects_each} sessions of {seconds:g} s for each cause, over the texture paper; the placeholder
is right but for it. *Others*: sessions in which anything else is named at the end.

| cause | size | named | median time, s | others |
|---|---|---|---|---|
{effects}

{seeds}
"""


def main() -> None:
    """Run the sessions and write the document."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=3, help="for each texture and factor")
    parser.add_argument("--each", type=int, default=6, help="sessions for each cause")
    parser.add_argument("--effects", type=int, default=3, help="sessions for each effect")
    parser.add_argument("--effects-only", action="store_true", help="print their table")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--out", type=File, default=OUT)
    given = parser.parse_args()
    seed = secrets.randbits(31) if given.seed is None else given.seed
    rng = np.random.default_rng(seed)
    if given.effects_only:
        sys.stdout.write("\n".join(effect_rows(rng, given.effects, given.seconds)) + "\n")
        return
    rows, covered = [], []
    for texture in ("flat", "paper", "sandpaper", "fabric1", "fabric2", "vinyl"):
        courses, begins = [], []
        for person in _people(rng, given.people):
            begins.append(_placeholder_db(person))
            courses.append(session(texture, person, 0.0, given.seconds, _seed(rng)))
        covered += [course.covered for course in courses]
        rows.append(_row(texture, begins, courses))
        sys.stderr.write(f"{rows[-1]}\n")
    alarms = []
    for cause, factors in CAUSES.items():
        courses = [
            session(
                "paper",
                _changed(Participant(), factors),
                100e-6 if cause.startswith("delay") else 0.0,
                given.seconds,
                _seed(rng),
            )
            for _ in range(given.each)
        ]
        alarms.append(_alarm_row(cause, courses))
        sys.stderr.write(f"{alarms[-1]}\n")
    effects = effect_rows(rng, given.effects, given.seconds)
    names = ("cutoff at 20 mm/s", "cutoff at 100 mm/s", "gain", "delay")
    share = np.mean(covered, axis=0)
    told = ", ".join(
        f"{name} {100 * part:.0f} %" for name, part in zip(names, share, strict=True)
    )
    text = TEXT.format(
        sessions=len(covered),
        seconds=given.seconds,
        within=WITHIN_DB,
        rows="\n".join(rows),
        covered=told,
        each=given.each,
        alarms="\n".join(alarms),
        effects_each=given.effects,
        effects="\n".join(effects),
        seeds=textwrap.fill(f"Seed {seed}.", 96),
    )
    given.out.write_text(text, encoding="utf-8")


def effect_rows(rng: np.random.Generator, each: int, seconds: float) -> list[str]:
    """Return the table of causes that the law does not have.

    Parameters
    ----------
    rng : Generator
        Of the seeds.
    each : int
        Sessions for each.
    seconds : float
        Of a session.
    """
    rows = []
    for name, parameters in EFFECTS.items():
        effect = ParticipantEffect(id=name, parameters=parameters)
        courses = [
            session("paper", Participant(effects=(effect,)), 0.0, seconds, _seed(rng))
            for _ in range(each)
        ]
        times = [course.named[name] for course in courses if name in course.alarms]
        others = sum(bool(set(course.alarms) - {name}) for course in courses)
        when = f"{np.median(times):.1f}" if times else "-"
        size = ", ".join(f"{value:g}" for value in parameters.values())
        rows.append(
            f"| `{name}` | {size} | {len(times)} of {each} | {when} | {others} of {each} |"
        )
        sys.stderr.write(f"{rows[-1]}\n")
    return rows


def _people(rng: np.random.Generator, count: int) -> Iterator[Participant]:
    for _ in range(count):
        person = draw_participant(rng)
        for factor in FACTORS:
            yield _changed(person, {"cutoff_0_hz": factor, "slope_hz_per_mm_s": factor})


def _changed(person: Participant, factors: dict[str, float]) -> Participant:
    return person.model_copy(
        update={name: factor * getattr(person, name) for name, factor in factors.items()}
    )


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


def _placeholder_db(person: Participant) -> float:
    laws = [
        coordinates.from_law(law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, 0.0)
        for law in (FrictionLaw(), person.law)
    ]
    return error_db(*laws)


def _row(texture: str, begins: list[float], courses: list[Course]) -> str:
    within = []
    for course in courses:
        above = np.flatnonzero(course.error_db > WITHIN_DB)
        first = above[-1] + 1 if above.size else 0
        within.append(course.at_s[first] if first < course.at_s.size else np.inf)
    ends = [course.error_db[-1] for course in courses]
    middle, most = (
        _seconds(float(np.quantile(within, q, method="higher"))) for q in (0.5, 0.9)
    )
    return (
        f"| {texture} | {np.median(begins):.2f} | {middle} ({most}) s "
        f"| {np.median(ends):.3f} ({max(ends):.3f}) dB |"
    )


def _seconds(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "not reached"


def _alarm_row(cause: str, courses: list[Course]) -> str:
    meant = cause.split(",")[0]
    times = [course.named[meant] for course in courses if meant in course.named]
    others = sum(bool(set(course.named) - {meant}) for course in courses)
    named = f"{len(times)} of {len(courses)}" if cause != "nothing" else "-"
    when = f"{np.median(times):.1f}" if times else "-"
    return f"| {cause} | {named} | {when} | {others} of {len(courses)} |"


if __name__ == "__main__":
    main()
