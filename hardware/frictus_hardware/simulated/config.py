"""Configuration of the simulated rigs."""

from typing import Annotated, Literal

from pydantic import Field

from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.clock import ClockSetting
from frictus_hardware.simulated.faults import Fault
from frictus_hardware.simulated.fingers import FingerConfig
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.participants import Participant
from frictus_hardware.simulated.strict import NonNegative, Positive, StrictModel
from frictus_hardware.simulated.touch import TouchConfig


class SimulatedConfig(StrictModel):
    """A rig that exists in software only.

    Attributes
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    lead_ms : float
        From handing a drive over to its playing.
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
    participant : Participant
        Whose finger it is.
    touch : TouchConfig
        Rate, latency and resolution of the touch sensor.
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
    clock: ClockSetting = "real"
    clock_skew_ppm: float = Field(default=0.0, ge=-1_000.0, le=1_000.0)
    screen_mm: Annotated[tuple[Positive, Positive], Field(strict=False)] = (70.0, 35.0)
    screen_peak_v: float = Field(default=75.0, gt=0.0, le=75.0)
    finger: FingerConfig = HumanStrokes()
    participant: Participant = Participant()
    touch: TouchConfig = TouchConfig()
    force_noise_n: NonNegative = 0.002
    accel_noise_m_s2: NonNegative = 0.05
    quantisation: bool = True
    seed: int = Field(default=0, ge=0)
    faults: Annotated[tuple[Fault, ...], Field(strict=False)] = ()

    @property
    def lead_samples(self) -> int:
        """The lead, in samples of the device."""
        return round(self.lead_ms * 1e-3 * self.sample_rate_hz)

    @property
    def screen(self) -> Screen:
        """The screen that the twin simulates."""
        return Screen(peak_v=self.screen_peak_v, size_mm=self.screen_mm)


class SimulatedDeviceConfig(StrictModel):
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
    def endpoint(self) -> tuple[str, int]:
        """Host and port."""
        host, port = self.address.rsplit(":", 1)
        return host, int(port)
