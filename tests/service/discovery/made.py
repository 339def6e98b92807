"""Evidence as trials would give it, made from predictions: no sample is simulated."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from frictus.model import Model
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.linear import Mobility, Mount, TransferFunction
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Prediction, Probe, Simulator, predict
from frictus_service.discovery.discover import discover, pose
from frictus_service.discovery.document import Discovery, NamedCause, StudyFacts
from frictus_service.discovery.evidence.spectra import HarmonicResponse, Stretches
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.discovery.problem.base_models import base_model, simulator_of
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.identification.observation.response import (
    ResponseRows,
    TrialObservations,
)
from frictus_service.study.trial import TrialInfo

Effects = Sequence[tuple[str, dict[str, float]]]

MOUNT = Mount().lateral
EVERY_MINUTES = 1.0 / 3.0
CENTRES_MM = (15.0, 35.0, 55.0)
BEGAN = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)

PAPER = simulator_of(base_model("paper", "friction"), MOUNT)
PAPER_SKIN = simulator_of(base_model("paper", "mobility"), MOUNT)


@dataclass(frozen=True, slots=True)
class Design:
    """Who is measured, where and how often; each condition's tones come in trials."""

    participants: int = 8
    speeds_mm_s: tuple[float, ...] = (20.0, 60.0, 100.0)
    forces_n: tuple[float, ...] = (0.25, 0.6)
    tones_hz: tuple[float, ...] = (31.0, 217.0, 907.0, 1888.0)
    tones_per_trial: int = 2
    repeats: int = 2
    blocked: bool = False
    """All trials of a speed after each other, the slow ones first."""

    def order(self, rng: np.random.Generator) -> list[tuple[float, float, tuple[float, ...]]]:
        """Return target speed, target force and tones of one person's trials, in order."""
        apart = len(self.tones_hz) // self.tones_per_trial
        sets = [self.tones_hz[k::apart] for k in range(apart)]
        trials = self.repeats * list(product(self.speeds_mm_s, self.forces_n, sets))
        shuffled = [trials[k] for k in rng.permutation(len(trials))]
        return sorted(shuffled, key=lambda trial: trial[0]) if self.blocked else shuffled


@dataclass(frozen=True, slots=True)
class Scatter:
    """Standard deviations: of logarithms, of shares, and of what the names say."""

    people: float = 0.2
    contact: float = 0.1
    condition: float = 0.05
    response: float = 0.002
    harmonic: float = 1e-3
    line_n2: float = 3e-7
    low: float = 0.3


USUAL = Scatter()
DESIGN = Design()


def made(
    rng: np.random.Generator,
    effects: Effects = (),
    design: Design = DESIGN,
    *,
    base: Simulator = PAPER,
    nominal: TransferFunction | None = MOUNT,
    scatter: Scatter = USUAL,
    mains_hz: float = 50.0,
) -> list[TrialEvidence]:
    """Return the evidence of a study whose people and rig are the base with effects in it."""
    found = []
    for number in range(design.participants):
        person = f"P{number:02}"
        own = _person(base, rng.normal(0.0, scatter.people, 3))
        conditions = {
            each: rng.normal(0.0, scatter.condition, 2)
            for each in product(design.speeds_mm_s, design.forces_n)
        }
        for order, (speed, force, tones) in enumerate(design.order(rng)):
            started = BEGAN + timedelta(days=number, minutes=order * EVERY_MINUTES)
            info = TrialInfo(
                id=f"{rng.integers(2**48):012x}",
                participant=person,
                session=1,
                order=order,
                speed_mm_s=speed,
                force_n=force,
                tones_hz=tones,
                drive_vpp=150.0,
                sample_rate_hz=20e3,
                started_utc=started.isoformat(),
            )
            gain, cutoff = conditions[speed, force] + rng.normal(0.0, (scatter.contact, 0.0))
            here = extended(_scaled(own, gain, cutoff), effects)
            minutes = order * EVERY_MINUTES
            found.append(_trial(info, here, nominal, minutes, scatter, mains_hz, rng))
    return found


def _person(base: Simulator, own: FloatArray) -> Simulator:
    skin = base.mobility
    mass, damping, stiffness = np.exp(own)
    own_skin = Mobility(
        skin.mass_kg * mass, skin.damping_n_s_m * damping, skin.stiffness_n_m * stiffness
    )
    return replace(_scaled(base, own[0], own[1]), mobility=own_skin)


def _scaled(base: Simulator, ln_gain: float, ln_cutoff: float) -> Simulator:
    gain, cutoff = float(np.exp(ln_gain)), float(np.exp(ln_cutoff))
    law = replace(
        base.law,
        gain_n=base.law.gain_n * gain,
        cutoff_0_hz=base.law.cutoff_0_hz * cutoff,
        slope_hz_per_mm_s=base.law.slope_hz_per_mm_s * cutoff,
    )
    return replace(base, law=law)


def _trial(
    info: TrialInfo,
    simulator: Simulator,
    nominal: TransferFunction | None,
    minutes: float,
    scatter: Scatter,
    mains_hz: float,
    rng: np.random.Generator,
) -> TrialEvidence:
    """Return one sweep each way, in thirds."""
    n_tones = len(info.tones_hz)
    at = _along(info, minutes, rng)
    tone = np.tile(info.tones_hz, 6)
    each = _rows_at(at, np.repeat(np.arange(6), n_tones))
    amplitude = np.full(tone.size, 0.5 / max(n_tones, 1))
    power = n_tones * amplitude**2 / 2.0
    probe = Probe(tone, amplitude.astype(complex), np.full(tone.size, 0.5), power, each)
    seen = predict(simulator, probe, nominal)
    rows = ResponseRows(
        sweep=np.where(each.direction > 0.0, 0, 1),
        direction=each.direction.astype(np.int64),
        third=np.tile(np.arange(3).repeat(n_tones), 2),
        speed_mm_s=each.speed_mm_s,
        normal_force_n=each.normal_force_n,
        position_mm=each.position_mm,
        tone_hz=tone,
        message=amplitude * np.exp(2j * np.pi * rng.random(tone.size)),
        friction_response=_noisy(seen.friction, scatter, rng),
        friction_variance=(scatter.response * np.abs(seen.friction)) ** 2,
        mobility=_noisy(seen.mobility, scatter, rng),
        mobility_variance=(scatter.response * np.abs(seen.mobility)) ** 2,
    )
    speed_mm_s = float(at.speed_mm_s.mean())
    observed = TrialObservations(
        info, info.id, True, (), (), speed_mm_s, info.force_n, rows, info.id
    )
    harmonics = _harmonics(seen, probe, scatter, rng)
    return TrialEvidence(observed, harmonics, _stretches(at, simulator, scatter, mains_hz, rng))


def _along(info: TrialInfo, minutes: float, rng: np.random.Generator) -> SlidingConditions:
    """Return where six thirds of sweeps were measured."""
    return SlidingConditions(
        speed_mm_s=info.speed_mm_s * rng.normal(1.0, 0.05, 6),
        normal_force_n=info.force_n * rng.normal(1.0, 0.05, 6),
        position_mm=np.tile(CENTRES_MM, 2),
        direction=np.repeat((1.0, -1.0), 3),
        minutes=np.full(6, minutes),
    )


def _rows_at(at: SlidingConditions, rows: NDArray[np.int64]) -> SlidingConditions:
    return SlidingConditions(
        at.speed_mm_s[rows],
        at.normal_force_n[rows],
        at.position_mm[rows],
        at.direction[rows],
        at.minutes[rows],
    )


def _noisy(values: Any, scatter: Scatter, rng: np.random.Generator) -> Any:
    real, imaginary = rng.normal(0.0, scatter.response, (2, values.size))
    return values * (1.0 + real + 1j * imaginary)


def _harmonics(
    seen: Prediction, probe: Probe, scatter: Scatter, rng: np.random.Generator
) -> HarmonicResponse:
    noise = rng.normal(0.0, scatter.harmonic, (4, probe.tone_hz.size))
    variance = np.full(probe.tone_hz.size, scatter.harmonic**2)
    return HarmonicResponse(
        message_mean=probe.message_mean,
        message_power=probe.message_power,
        second=seen.second + noise[0] + 1j * noise[1],
        second_variance=variance,
        third=seen.third + noise[2] + 1j * noise[3],
        third_variance=variance,
        centroid_hz=probe.tone_hz,
        spread_hz=np.zeros(probe.tone_hz.size),
        skewness=np.zeros(probe.tone_hz.size),
        mobility_centroid_hz=probe.tone_hz,
        mobility_spread_hz=np.zeros(probe.tone_hz.size),
        mobility_skewness=np.zeros(probe.tone_hz.size),
        speed_spread_mm_s=np.zeros(probe.tone_hz.size),
    )


def _stretches(
    at: SlidingConditions,
    simulator: Simulator,
    scatter: Scatter,
    mains_hz: float,
    rng: np.random.Generator,
) -> Stretches:
    nothing = np.zeros(6)
    probe = Probe(nothing + 100.0, nothing.astype(complex), nothing, nothing, at)
    seen = predict(simulator, probe, simulator.mount)
    line = np.square(seen.line_n) / 2.0
    beside = rng.normal(0.0, scatter.line_n2, (2, 6))
    quiet = 1e-5 * at.normal_force_n / 0.4 * np.exp(rng.normal(0.0, scatter.low, 6))
    return Stretches(
        sweep=np.repeat((0, 1), 3),
        direction=at.direction.astype(np.int64),
        third=np.tile(np.arange(3), 2),
        speed_mm_s=at.speed_mm_s,
        normal_force_n=at.normal_force_n,
        position_mm=at.position_mm,
        seconds=20.0 / at.speed_mm_s,
        line50_n2=beside[0] + line * (mains_hz == 50.0),
        line50_variance=nothing + scatter.line_n2**2,
        line60_n2=beside[1] + line * (mains_hz == 60.0),
        line60_variance=nothing + scatter.line_n2**2,
        low_n2=quiet + seen.low_n2,
        low_variance=(scatter.low * quiet) ** 2,
    )


def skins_with_mode(
    rng: np.random.Generator,
    share: float,
    frequency_hz: float,
    quality: float,
    more: Effects = (),
    speeds_mm_s: tuple[float, ...] = (60.0,),
) -> DiscoveryProblem:
    """Return the problem of six people whose skins have a second mode, at seven tones."""
    design = Design(
        participants=6,
        speeds_mm_s=speeds_mm_s,
        forces_n=(0.4,),
        tones_hz=(40.0, 80.0, 150.0, 300.0, 500.0, 750.0, 1900.0),
        tones_per_trial=1,
    )
    mode = {"share": share, "frequency_hz": frequency_hz, "quality": quality}
    evidence = made(rng, [("second_mode", mode), *more], design, base=PAPER_SKIN)
    problem = pose(evidence, facts(evidence), MOUNT, base_model("paper", "mobility")).problem
    assert problem is not None
    return problem


def facts(evidence: Sequence[TrialEvidence]) -> StudyFacts:
    """Return what a document says of the study."""
    people = {one.observed.info.participant for one in evidence}
    return StudyFacts(
        path="made.h5",
        sha256="0" * 64,
        participants=len(people),
        trials=len(evidence),
        trials_used=0,
    )


def found_in(
    evidence: Sequence[TrialEvidence],
    base: Model | None = None,
    mount: TransferFunction | None = MOUNT,
) -> Discovery:
    """Return what the analysis says, with one thread: matrices are small."""
    base = base or base_model("paper", "friction")
    with threadpool_limits(limits=1):
        return discover(evidence, facts(evidence), mount, base, seed=1)


def named(document: Discovery) -> set[str]:
    """Return the causes that a document names."""
    return {cause.id for cause in document.causes}


def suspected(document: Discovery) -> set[str]:
    """Return the causes that a document names, or of which it cannot say which it is."""
    return named(document).union(*(pair.between for pair in document.cannot_tell))


def cause_in(document: Discovery, name: str) -> NamedCause:
    """Return a named cause."""
    return next(cause for cause in document.causes if cause.id == name)


def dose_in(document: Discovery, name: str) -> float:
    """Return the size of a named cause: its first parameter."""
    return next(iter(cause_in(document, name).parameters.values())).value
