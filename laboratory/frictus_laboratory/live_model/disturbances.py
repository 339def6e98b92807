"""What is not as the tracker takes it to be: a finger that changes, effects, faults."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.schedule import (
    REFERENCE_FORCE_N,
    REFERENCE_SPEED_MM_S,
    SlidingConditions,
)
from frictus_hardware.physics.simulator import Simulator
from frictus_hardware.simulated.config import SimulatedParticipant, WithinPersonScatter
from frictus_hardware.simulated.faults import RANGE
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion


class SessionSpan(NamedTuple):
    """Where in its session a piece of a motion lies.

    Attributes
    ----------
    at_s : float
        When it begins.
    contact, stroke : int
        Numbers, rising with each touch and with each turn.
    speed_mm_s, normal_force_n : float
        Means over the piece.
    """

    at_s: float
    contact: int
    stroke: int
    speed_mm_s: float
    normal_force_n: float


class Disturbance:
    """Nothing is disturbed; what is overrides a method."""

    def person(self, person: SimulatedParticipant, span: SessionSpan) -> SimulatedParticipant:
        """Return whose finger it is now."""
        return person

    def simulator(self, person: SimulatedParticipant, span: SessionSpan) -> Simulator:
        """Return the finger and the rig under it."""
        return Simulator(law=person.law, mobility=person.mobility)

    def predicted(self, course: PredictedMotion, span: SessionSpan) -> PredictedMotion:
        """Return the motion that the rig takes for the finger's."""
        return course

    def touched(self, report: TouchReport, span: SessionSpan) -> TouchReport:
        """Return what the touch sensor says."""
        return report

    def sensed(self, part: AlignedSamples, span: SessionSpan) -> AlignedSamples:
        """Return what the tracker is given."""
        return part

    def speed_scale(self, span: SessionSpan) -> float:
        """Return the speed that the rig takes for the finger's, over the true one."""
        return 1.0


def scaled(person: SimulatedParticipant, gain: float, cutoff: float) -> SimulatedParticipant:
    """Return a person with another gain and cutoff.

    Parameters
    ----------
    person : SimulatedParticipant
        To begin with.
    gain, cutoff : float
        Factors.
    """
    return person.model_copy(
        update={
            "gain_n": gain * person.gain_n,
            "cutoff_0_hz": cutoff * person.cutoff_0_hz,
            "slope_hz_per_mm_s": cutoff * person.slope_hz_per_mm_s,
        }
    )


@dataclass(frozen=True, slots=True)
class WithinPerson(Disturbance):
    """The gain differs from contact to contact and the cutoff from stroke to stroke.

    Attributes
    ----------
    seed : int
        Of what each contact and each stroke draws.
    """

    seed: int

    def person(self, person: SimulatedParticipant, span: SessionSpan) -> SimulatedParticipant:
        """Return the person in this contact and stroke."""
        scatter = WithinPersonScatter()
        drawn = (
            np.random.default_rng((self.seed, which, number)).standard_normal()
            for which, number in enumerate((span.contact, span.stroke))
        )
        gain, cutoff = next(drawn), next(drawn)
        return scaled(
            person,
            math.exp(scatter.gain_per_trial * gain),
            math.exp(scatter.cutoff_per_condition * cutoff),
        )


@dataclass(frozen=True, slots=True)
class DriftingLaw(Disturbance):
    """Gain and cutoff follow the time.

    Attributes
    ----------
    gain, cutoff : callable
        Factor from the seconds since the session began.
    """

    gain: Callable[[float], float]
    cutoff: Callable[[float], float]

    def person(self, person: SimulatedParticipant, span: SessionSpan) -> SimulatedParticipant:
        """Return the person at this time."""
        return scaled(person, self.gain(span.at_s), self.cutoff(span.at_s))


def drift(per_minute: float) -> DriftingLaw:
    """Return gain and cutoff that rise steadily, in steps of a second.

    Parameters
    ----------
    per_minute : float
        Share by which both rise.
    """

    def factor(at_s: float) -> float:
        return math.exp(per_minute * math.floor(at_s) / 60.0)

    return DriftingLaw(factor, factor)


def gain_step(factor: float, at_s: float, within_s: float) -> DriftingLaw:
    """Return a gain that becomes another within some time.

    Parameters
    ----------
    factor : float
        At the end.
    at_s, within_s : float
        When it begins, and how long it takes.
    """

    def gain(now_s: float) -> float:
        share = min(max((now_s - at_s) / max(within_s, 1e-9), 0.0), 1.0)
        return float(factor**share)

    return DriftingLaw(gain, lambda now_s: 1.0)


@dataclass(frozen=True, slots=True)
class NewFinger(Disturbance):
    """From some time on another person's finger explores, without notice.

    Attributes
    ----------
    other : SimulatedParticipant
        Whose.
    at_s : float
        From when on.
    every_s : float
        From then on the two take turns, each so long.
    """

    other: SimulatedParticipant
    at_s: float
    every_s: float = math.inf

    def person(self, person: SimulatedParticipant, span: SessionSpan) -> SimulatedParticipant:
        """Return whose finger it is now."""
        turns = (span.at_s - self.at_s) // self.every_s
        return self.other if turns >= 0.0 and turns % 2.0 == 0.0 else person


@dataclass(frozen=True, slots=True)
class WithEffect(Disturbance):
    """An effect of the catalogue, from the beginning.

    Attributes
    ----------
    id : str
        One of `frictus_hardware.physics.effects.EFFECTS`.
    parameters : dict
        By name.
    """

    id: str
    parameters: Mapping[str, float]

    def simulator(self, person: SimulatedParticipant, span: SessionSpan) -> Simulator:
        """Return the simulator with the effect."""
        bare = Simulator(law=person.law, mobility=person.mobility)
        return extended(bare, [(self.id, self.parameters)])


@dataclass(frozen=True, slots=True)
class Later(Disturbance):
    """What disturbs the simulator begins during the session.

    Attributes
    ----------
    what : Disturbance
        Of the simulator.
    at_s : float
        From when on.
    """

    what: Disturbance
    at_s: float

    def simulator(self, person: SimulatedParticipant, span: SessionSpan) -> Simulator:
        """Return the simulator, later with the effect."""
        now = self.what if span.at_s >= self.at_s else Disturbance()
        return now.simulator(person, span)


@dataclass(frozen=True, slots=True)
class _SpeedTimesForce:
    """``exp(a ln(v / v0) ln(F / F0))``."""

    exponent: float

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it in given circumstances."""
        by_speed = np.log(circumstances.speed_mm_s / REFERENCE_SPEED_MM_S)
        by_force = np.log(circumstances.normal_force_n / REFERENCE_FORCE_N)
        factor: FloatArray = np.exp(self.exponent * by_speed * by_force)
        return factor


@dataclass(frozen=True, slots=True)
class SpeedTimesForce(Disturbance):
    """The gain follows speed times force, which no cause of the catalogue does.

    Attributes
    ----------
    exponent : float
        Of the product of the logarithms.
    """

    exponent: float

    def simulator(self, person: SimulatedParticipant, span: SessionSpan) -> Simulator:
        """Return the simulator with it."""
        bare = Simulator(law=person.law, mobility=person.mobility)
        terms = (_SpeedTimesForce(self.exponent),)
        return replace(bare, schedule=replace(bare.schedule, gain_factors=terms))


@dataclass(frozen=True, slots=True)
class Section(Disturbance):
    """The response has a peak or a notch: ``1 + depth B``, B a band pass.

    Attributes
    ----------
    depth : float
        Of the peak; negative of a notch.
    frequency_hz, quality : float
        Of the band pass.
    fast_only : bool
        Whether it grows with the speed, half at 60 mm/s.
    """

    depth: float
    frequency_hz: float
    quality: float
    fast_only: bool = False

    def simulator(self, person: SimulatedParticipant, span: SessionSpan) -> Simulator:
        """Return the simulator with it."""
        depth = self.depth
        if self.fast_only:
            depth /= 1.0 + math.exp((REFERENCE_SPEED_MM_S - span.speed_mm_s) / 6.0)
        centre = 2.0 * math.pi * self.frequency_hz
        width = centre / self.quality
        section = TransferFunction(
            (1.0, (1.0 + depth) * width, centre**2), (1.0, width, centre**2)
        )
        bare = Simulator(law=person.law, mobility=person.mobility)
        return replace(bare, drive_filter=section)


SCALED: Final = 1.3
"""Of a touch sensor that takes the screen for larger than it is."""
CLIPPED_N: Final = 0.35
"""End of the range of a sensor whose amplifier is set too high: of the friction of most people
on most textures the upper part is cut off."""
FAULTS: Final = (
    *("force dead", "force stuck", "force saturated", "force clipped", "force loose"),
    *("gaps", "underruns", "clock stepped", "touch scaled", "touch frozen"),
)


@dataclass(frozen=True, slots=True)
class Faulty(Disturbance):
    """A sensor, the link or the clock fails.

    Attributes
    ----------
    fault : str
        One of `FAULTS`.
    at_s : float
        From when on.
    """

    fault: str
    at_s: float

    def speed_scale(self, span: SessionSpan) -> float:
        """Return the speed that the rig takes for the finger's, over the true one."""
        return SCALED if self.fault == "touch scaled" and span.at_s >= self.at_s else 1.0

    def predicted(self, course: PredictedMotion, span: SessionSpan) -> PredictedMotion:
        """Return the motion as a lying touch sensor has it."""
        if span.at_s < self.at_s:
            return course
        if self.fault == "touch scaled":
            motion = BlockMotion(*(SCALED * value for value in course.motion))
            return course._replace(motion=motion, left=None)
        if self.fault == "touch frozen":
            return course._replace(
                motion=BlockMotion(35.0, 17.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), left=None
            )
        return course

    def touched(self, report: TouchReport, span: SessionSpan) -> TouchReport:
        """Return what a lying touch sensor says."""
        if span.at_s < self.at_s:
            return report
        if self.fault == "touch scaled":
            return replace(report, x_mm=SCALED * report.x_mm, y_mm=SCALED * report.y_mm)
        if self.fault == "touch frozen":
            return replace(report, x_mm=35.0, y_mm=17.0)
        return report

    def sensed(self, part: AlignedSamples, span: SessionSpan) -> AlignedSamples:
        """Return what the tracker is given of it."""
        if span.at_s < self.at_s:
            return part
        if self.fault == "gaps":
            return replace(part, missing_samples=100)
        if self.fault == "underruns":
            return replace(part, flags=Flag.UNDERRUN)
        if self.fault == "clock stepped":
            return replace(part, utc_ns=part.utc_ns + 3_600_000_000_000)
        if not self.fault.startswith("force"):
            return part
        force = self._force(part.data["force"].astype(np.float64), part.first_sample)
        return replace(part, data={**part.data, "force": force.astype(np.float32)})

    def _force(self, force_n: FloatArray, first_sample: int) -> FloatArray:
        since = first_sample + np.arange(force_n.shape[1])
        match self.fault.removeprefix("force "):
            case "dead":
                return np.zeros_like(force_n)
            case "stuck":
                return np.broadcast_to([[0.21], [0.004], [0.41]], force_n.shape)
            case "saturated":
                side = np.where(since % 60 < 30, RANGE["force"], -RANGE["force"])
                return np.tile(side, (3, 1))
            case "clipped":
                clipped = force_n.copy()
                clipped[:2] = np.clip(clipped[:2], -CLIPPED_N, CLIPPED_N)
                return clipped
            case "loose":
                rattle = (
                    4.0
                    * np.sin(0.003 * since)
                    * np.sin(0.2 * since + 3.0 * np.sin(0.0017 * since))
                )
                loose: FloatArray = 0.1 * force_n + rattle
                return loose
        return force_n
