"""Configuration of the simulated rigs: participants, virtual fingers, sensors and clock."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from frictus_hardware.arguments import (
    NonNegative,
    Positive,
    SideMm,
    StrictModel,
    longest_lead_ms,
    require_max_lead,
)
from frictus_hardware.base import Backend, RigConfig
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.clock import ClockSetting, scale_of
from frictus_hardware.simulated.faults import Fault
from frictus_hardware.simulated.guided import ClientFinger, GuidedStrokes
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.sensors import NailConfig, TouchConfig
from frictus_hardware.simulated.strokes import Circles, SinusoidalStrokes, SteadyStrokes, Taps
from frictus_hardware.simulated.takeover import TakeoverStrokes

if TYPE_CHECKING:
    from frictus_hardware.physics.friction import FrictionLaw
    from frictus_hardware.physics.linear import Mobility
    from frictus_hardware.physics.simulator import Simulator


class ParticipantEffect(StrictModel):
    """An effect that a finger, or the rig under it, has beyond the law.

    Attributes
    ----------
    id : str
        One of `frictus_hardware.physics.effects.EFFECTS`.
    parameters : dict
        By name, in the units that the effect states.
    """

    id: str = Field(min_length=1, max_length=100)
    parameters: dict[str, float] = Field(default_factory=dict)


class SimulatedParticipant(StrictModel):
    """One person's finger on the screen. The defaults are the paper's values.

    Attributes
    ----------
    gain_n, cutoff_0_hz, slope_hz_per_mm_s : float
        The friction law.
    mass_kg, damping_n_s_m, stiffness_n_m : float
        The skin.
    friction_coefficient : float
        Of finger and glass without drive.
    effects : tuple of ParticipantEffect
        In the order in which they are added.
    """

    gain_n: Positive = 0.39
    cutoff_0_hz: Positive = 385.68
    slope_hz_per_mm_s: NonNegative = 13.811
    mass_kg: Positive = 0.0015
    damping_n_s_m: Positive = 1.3
    stiffness_n_m: Positive = 444.0
    friction_coefficient: float = Field(default=0.5, ge=0.0, le=5.0)
    effects: Annotated[tuple[ParticipantEffect, ...], Field(strict=False)] = ()

    @property
    def law(self) -> "FrictionLaw":
        """The friction law."""
        # Late, because a process that only reads a configuration needs no compiler.
        from frictus_hardware.physics.friction import FrictionLaw

        return FrictionLaw(self.gain_n, self.cutoff_0_hz, self.slope_hz_per_mm_s)

    @property
    def mobility(self) -> "Mobility":
        """The skin."""
        from frictus_hardware.physics.linear import Mobility

        return Mobility(self.mass_kg, self.damping_n_s_m, self.stiffness_n_m)

    @property
    def simulator(self) -> "Simulator":
        """Law and skin, with the effects in them.

        Raises
        ------
        UnknownEffectError, EffectParameterError
            If an effect is not known, or a parameter missing, unknown or out of its range.
        """
        from frictus_hardware.physics.effects import extended
        from frictus_hardware.physics.simulator import Simulator

        bare = Simulator(law=self.law, mobility=self.mobility)
        return extended(bare, [(effect.id, effect.parameters) for effect in self.effects])


SPREAD = {
    "gain_n": 0.35,
    "cutoff_0_hz": 0.25,
    "slope_hz_per_mm_s": 0.30,
    "mass_kg": 0.30,
    "damping_n_s_m": 0.25,
    "stiffness_n_m": 0.35,
    "friction_coefficient": 0.30,
}
"""Standard deviation of the logarithm over the population. The paper shows box plots only;
these are assumed, of the size of its boxes."""


def draw_participant(rng: np.random.Generator) -> SimulatedParticipant:
    """Return a random participant; each parameter is lognormal around the paper's value.

    Parameters
    ----------
    rng : Generator
        Source of everything random.
    """
    middle = SimulatedParticipant().model_dump()
    return SimulatedParticipant(
        **{
            name: middle[name] * float(np.exp(spread * rng.standard_normal()))
            for name, spread in SPREAD.items()
        }
    )


@dataclass(frozen=True, slots=True)
class WithinPersonScatter:
    """What varies within a person, as shares of the value: standard deviations.

    The paper's residuals (72 % of the gain, 31 % of the middle cutoff) also hold the errors of
    its estimator; this is the part that is taken as true.

    Attributes
    ----------
    gain_per_trial : float
        The contact is made anew in each trial.
    cutoff_per_condition, skin_per_condition : float
        Of speed and force; `skin` of mass, damping and stiffness each.
    """

    gain_per_trial: float = 0.10
    cutoff_per_condition: float = 0.05
    skin_per_condition: float = 0.05


FingerConfig = Annotated[
    SteadyStrokes
    | SinusoidalStrokes
    | HumanStrokes
    | Circles
    | Taps
    | ClientFinger
    | GuidedStrokes
    | TakeoverStrokes,
    Field(discriminator="kind"),
]


class SimulatedConfig(RigConfig):
    """A rig that exists in software only.

    Attributes
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    lead_ms : float
        From handing a drive over to its playing.
    max_lead_ms : float or None
        To which the lead may grow at an arming after an underrun, from `lead_ms` (never) on;
        None: to 20 ms, or not at all where `lead_ms` is longer.
    clock : "real", "virtual" or float
        A number, 0.01 to 100, runs the device that many times faster than real time; the
        virtual clock runs as fast as the rig is asked, and nothing is ever late.
    clock_skew_ppm : float
        How much faster than nominal the device's clock runs.
    screen_mm : tuple of float
        Width along x, height along y.
    screen_peak_v : float
        Limit of the output.
    finger : FingerConfig
        How it moves.
    participant : SimulatedParticipant
        Whose finger it is.
    touch : TouchConfig
        Rate, latency and resolution of the touch sensor.
    nail : NailConfig
        How the accelerometer sits on the nail.
    force_noise_n, accel_noise_m_s2 : float
        Standard deviation per sample and axis.
    quantisation : bool
        Whether force and acceleration come in the steps of a 16 bit converter.
    seed : int
        Of finger and noise.
    faults : tuple of Fault
        What shall go wrong.
    """

    kind: Literal["simulated"] = "simulated"
    sample_rate_hz: float = Field(default=20_000.0, ge=1_000.0, le=200_000.0)
    lead_ms: float = Field(default=20.0, gt=0.0, le=1_000.0)
    max_lead_ms: float | None = Field(default=None, gt=0.0, le=1_000.0)
    clock: ClockSetting = "real"
    clock_skew_ppm: float = Field(default=0.0, ge=-1_000.0, le=1_000.0)
    screen_mm: Annotated[tuple[SideMm, SideMm], Field(strict=False)] = (70.0, 35.0)
    screen_peak_v: float = Field(default=75.0, gt=0.0, le=75.0)
    finger: FingerConfig = HumanStrokes()
    participant: SimulatedParticipant = SimulatedParticipant()
    touch: TouchConfig = TouchConfig()
    nail: NailConfig = NailConfig()
    force_noise_n: NonNegative = 0.002
    accel_noise_m_s2: NonNegative = 0.05
    quantisation: bool = True
    seed: int = Field(default=0, ge=0)
    faults: Annotated[tuple[Fault, ...], Field(strict=False)] = ()

    @property
    def nominal_rate_hz(self) -> float:
        """Samples per second of the device's clock."""
        return self.sample_rate_hz

    @property
    def clock_scale(self) -> float:
        """Seconds of the device's clock per second of this machine's."""
        return scale_of(self.clock)

    @property
    def follows_guidance(self) -> bool:
        """Whether the finger does what a participant is asked to do."""
        return self.finger.kind in ("guided", "takeover")

    def make(self) -> Backend:
        """Return the rig, not yet open."""
        from frictus_hardware.simulated.rig import SimulatedRig

        return SimulatedRig(self)

    @property
    def lead_samples(self) -> int:
        """The lead, in samples of the device."""
        return round(self.lead_ms * 1e-3 * self.sample_rate_hz)

    @property
    def max_lead_samples(self) -> int:
        """The longest lead, in samples of the device."""
        longest_ms = longest_lead_ms(self.lead_ms, self.max_lead_ms)
        return round(longest_ms * 1e-3 * self.sample_rate_hz)

    @model_validator(mode="after")
    def _lead_in_order(self) -> Self:
        require_max_lead(self.lead_ms, self.max_lead_ms)
        return self

    @property
    def screen(self) -> Screen:
        """The screen that the twin simulates."""
        return Screen(peak_v=self.screen_peak_v, size_mm=self.screen_mm)


class SimulatedDeviceConfig(RigConfig):
    """A simulated rig in a process of its own, which outlives its client and holds its output.

    Attributes
    ----------
    address : str
        host:port where `python -m frictus_hardware.simulated.device` listens.
    authkey : str
        What both sides were given; it guards against mix-ups, not against attackers.
    timeout_s : float
        How long the device may take to answer, beyond the block itself.
    rig : SimulatedConfig
        What the device simulates; its clock must not be virtual.
    """

    kind: Literal["simulated_device"] = "simulated_device"
    address: str = Field(default="127.0.0.1:7450", pattern=r"^[^:]+:\d{1,5}$")
    authkey: str = Field(default="frictus", min_length=1)
    timeout_s: float = Field(default=5.0, gt=0.0, le=60.0)
    rig: SimulatedConfig = SimulatedConfig()

    @property
    def nominal_rate_hz(self) -> float:
        """Samples per second of the device's clock."""
        return self.rig.sample_rate_hz

    @property
    def clock_scale(self) -> float:
        """Seconds of the device's clock per second of this machine's."""
        return self.rig.clock_scale

    def make(self) -> Backend:
        """Return the rig, not yet open."""
        from frictus_hardware.simulated.device_rig import SimulatedDeviceRig

        return SimulatedDeviceRig(self)

    def reset(self) -> None:
        """Put the output of the device to zero, whoever drives it."""
        from frictus_hardware.simulated.device_rig import reset

        reset(self)

    @property
    def endpoint(self) -> tuple[str, int]:
        """Host and port."""
        host, port = self.address.rsplit(":", 1)
        return host, int(port)
