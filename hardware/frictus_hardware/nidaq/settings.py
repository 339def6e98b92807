"""The rig on an NI device as it stands in a configuration file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from frictus_hardware.arguments import Positive, SideMm, StrictModel
from frictus_hardware.base import Backend, RigConfig
from frictus_hardware.nidaq.config import (
    AuxInput,
    Inputs,
    InterlockLine,
    NiConfig,
    ServerTls,
    Terminals,
)
from frictus_hardware.sensors.analogue import AnalogueChannel

Channel = Annotated[str, Field(pattern=r"^ai\d+$")]
Three = Annotated[tuple[float, float, float], Field(strict=False)]
Turn = Annotated[tuple[Literal["x", "y", "z"], float], Field(strict=False)]
Turns = Annotated[tuple[Turn, ...], Field(strict=False)]
Range = Annotated[float, Field(gt=0.0, le=10.0)]
SensorAxis = Literal["+x", "-x", "+y", "-y"]


class ForceSettings(StrictModel):
    """The force sensor under the screen.

    Attributes
    ----------
    calibration : Path
        The maker's file (.cal) of this very sensor.
    channels : tuple of str
        The six gauges, in the order of the file.
    range_v : float
        Input range, +/-V.
    terminals : str
        Wiring of the gauges, as nidaqmx names it.
    rotation : tuple of (axis, degrees)
        From the sensor's frame to the rig's, one after another about the rig's axes. In the
        rig's frame a finger that slides along +x pushes the screen along +x, and one that
        presses pushes along +z.
    bias_v : tuple of six float or None
        Volts of the gauges without load; None: measured at the start, when nobody may touch.
    """

    calibration: Path
    channels: Annotated[tuple[Channel, ...], Field(strict=False)] = tuple(
        f"ai{index}" for index in range(6)
    )
    range_v: Range = 10.0
    terminals: Terminals = "differential"
    rotation: Turns = ()
    bias_v: Annotated[tuple[float, ...], Field(strict=False)] | None = None


class AccelSettings(StrictModel):
    """The accelerometer on the nail.

    Attributes
    ----------
    channels : tuple of str
        Its x, y and z.
    range_v, terminals
        As of the force.
    sensitivity_v_per_g, zero_g_v : tuple of three float
        From its data sheet, or calibrated.
    output_range_v : tuple of float
        Lowest and highest volts that it can put out.
    rotation : tuple of (axis, degrees)
        From its frame to the rig's.
    """

    channels: Annotated[tuple[Channel, ...], Field(strict=False)]
    sensitivity_v_per_g: Three
    range_v: Range = 5.0
    terminals: Terminals = "rse"
    zero_g_v: Three = (0.9, 0.9, 0.9)
    output_range_v: Annotated[tuple[float, float], Field(strict=False)] = (0.0, 1.8)
    rotation: Turns = ()


class MonitorSettings(StrictModel):
    """The input that reads the amplifier's output back.

    Attributes
    ----------
    channel : str
        As the driver names it.
    gain : float
        Screen volts per volt of the input.
    range_v, terminals
        As of the force.
    """

    channel: Channel
    gain: Positive = 50.0
    range_v: Range = 10.0
    terminals: Terminals = "rse"


class AuxSettings(StrictModel):
    """A further analogue input, in step with the rest; ``value = scale volts + offset``.

    Attributes
    ----------
    name, unit : str
        As people read it, and its unit.
    channel : str
        As the driver names it.
    scale, offset : float
        Units per volt; in the unit.
    range_v, terminals
        As of the force.
    """

    name: str = Field(min_length=1, max_length=64)
    unit: str = Field(min_length=1, max_length=32)
    channel: Channel
    scale: float = 1.0
    offset: float = 0.0
    range_v: Range = 10.0
    terminals: Terminals = "rse"

    @property
    def input(self) -> AuxInput:
        """What the device is told, and what becomes of the volts."""
        ends = (-self.range_v, self.range_v)
        channel = AnalogueChannel(self.name, self.unit, self.scale, self.offset, ends)
        return AuxInput(channel, Inputs((self.channel,), self.range_v, self.terminals))


class NeonodeSettings(StrictModel):
    """A Neonode touch sensor, over HID.

    Attributes
    ----------
    latency_ms : float
        Declared age of a report when it arrives.
    x_along, y_along : str
        The direction of the sensor that runs along +x and +y of the screen.
    origin_mm : tuple of float
        Where the sensor's (0, 0) is on the screen.
    mm_per_count : float
        Of the sensor's position.
    stale_ms : float
        A finger in contact of which nothing is told for so long is lost.
    serial_number : str or None
        None: the first that is found.
    """

    kind: Literal["neonode"] = "neonode"
    latency_ms: float = Field(default=16.0, ge=0.0, le=1_000.0)
    x_along: SensorAxis = "+x"
    y_along: SensorAxis = "+y"
    origin_mm: Annotated[tuple[float, float], Field(strict=False)] = (0.0, 0.0)
    mm_per_count: Positive = 0.1
    stale_ms: float = Field(default=100.0, ge=20.0, le=1_000.0)
    serial_number: str | None = None


class PointerSettings(StrictModel):
    """A declared substitute: points that a client sends. Every message says so.

    Attributes
    ----------
    latency_ms : float
        Declared age of a point when it arrives.
    """

    kind: Literal["pointer"] = "pointer"
    latency_ms: float = Field(default=20.0, ge=0.0, le=1_000.0)


TouchSettings = Annotated[NeonodeSettings | PointerSettings, Field(discriminator="kind")]


class InterlockSettings(StrictModel):
    """A digital line to the amplifier's interlock, which the device pulls low by itself.

    Attributes
    ----------
    line, timeout_ms
        See `frictus_hardware.nidaq.config.InterlockLine`.
    """

    line: str
    timeout_ms: float = 200.0


class TlsSettings(StrictModel):
    """Certificates for an encrypted link to NI's gRPC device server.

    Attributes
    ----------
    authority, certificate
        See `frictus_hardware.nidaq.config.ServerTls`.
    """

    authority: Path
    certificate: Path | None = None


class NiRigConfig(RigConfig):
    """A rig on an NI device, local or behind NI's gRPC device server.

    Attributes
    ----------
    device, output, address, tls, interlock, deadline_s, sample_rate_hz
        See `frictus_hardware.nidaq.config.NiConfig`.
    lead_ms, max_lead_ms, reserve_ms
        See `frictus_hardware.nidaq.config.NiConfig`.
    transfer_ms : float or None
        Longest piece that is written or read in one call; `NiConfig.block_ms`.
    amplifier_gain : float
        Screen volts per volt of the output.
    screen_peak_v : float
        Limit of the screen volts.
    screen_mm : tuple of float
        Width along x, height along y.
    force, accel, monitor, touch, aux
        What is wired to it.
    """

    kind: Literal["nidaqmx"] = "nidaqmx"
    force: ForceSettings
    accel: AccelSettings
    monitor: MonitorSettings
    touch: TouchSettings
    aux: Annotated[tuple[AuxSettings, ...], Field(strict=False)] = ()
    device: str = "Dev1"
    output: str = "ao0"
    amplifier_gain: float = 50.0
    screen_peak_v: float = 75.0
    screen_mm: Annotated[tuple[SideMm, SideMm], Field(strict=False)] = (70.0, 35.0)
    sample_rate_hz: float = 20_000.0
    transfer_ms: float | None = None
    lead_ms: float = 30.0
    max_lead_ms: float | None = None
    reserve_ms: float | None = None
    address: str | None = None
    tls: TlsSettings | None = None
    interlock: InterlockSettings | None = None
    deadline_s: float = 1.0

    @property
    def wiring(self) -> NiConfig:
        """What the device is told."""
        force, accel, monitor = self.force, self.accel, self.monitor
        tls, line = self.tls, self.interlock
        return NiConfig(
            force=Inputs(force.channels, force.range_v, force.terminals),
            accel=Inputs(accel.channels, accel.range_v, accel.terminals),
            monitor=Inputs((monitor.channel,), monitor.range_v, monitor.terminals),
            aux=tuple(each.input for each in self.aux),
            device=self.device,
            output=self.output,
            amplifier_gain=self.amplifier_gain,
            monitor_gain=monitor.gain,
            screen_peak_v=self.screen_peak_v,
            screen_mm=self.screen_mm,
            sample_rate_hz=self.sample_rate_hz,
            block_ms=self.transfer_ms,
            lead_ms=self.lead_ms,
            max_lead_ms=self.max_lead_ms,
            reserve_ms=self.reserve_ms,
            address=self.address,
            tls=None if tls is None else ServerTls(tls.authority, tls.certificate),
            interlock=None if line is None else InterlockLine(line.line, line.timeout_ms),
            deadline_s=self.deadline_s,
        )

    @property
    def nominal_rate_hz(self) -> float:
        """Samples per second of the device's clock."""
        return self.sample_rate_hz

    @property
    def files(self) -> Mapping[tuple[str, ...], Path]:
        """The calibration of the force sensor, by the keys that name it."""
        return {("force", "calibration"): self.force.calibration}

    def make(self) -> Backend:
        """Return the rig, not yet open.

        Raises
        ------
        ConfigError
            If the configuration does not fit the device.
        """
        from frictus_hardware.nidaq.assembly import make_rig

        return make_rig(self)

    def reset(self) -> None:
        """Put the outputs of the device to 0 V, whoever drives it.

        Raises
        ------
        HardwareError
            If the device cannot be reached; its output may still hold its last value.
        """
        from frictus_hardware.nidaq.assembly import reset

        reset(self.wiring)

    def within(self, folder: Path) -> Self:
        """Return this configuration with relative files made relative to `folder`."""
        calibration = folder / self.force.calibration
        force = self.force.model_copy(update={"calibration": calibration})
        tls = self.tls
        if tls is not None:
            ours = tls.certificate and folder / tls.certificate
            tls = TlsSettings(authority=folder / tls.authority, certificate=ours)
        return self.model_copy(update={"force": force, "tls": tls})

    @model_validator(mode="after")
    def _wired(self) -> Self:
        _ = self.wiring  # refuses what cannot be, and says what is accepted
        return self
