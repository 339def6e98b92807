"""What the NI-DAQmx backend has to be told: channels, ranges, gains, timing."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, get_args

from frictus_hardware.arguments import longest_lead_ms, require_max_lead
from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.analogue import AnalogueChannel

Terminals = Literal["default", "rse", "nrse", "differential", "pseudo_differential"]

_CHANNEL = re.compile(r"ai\d+")
_OUTPUT = re.compile(r"ao\d+")
_LINE = re.compile(r"port\d+/line\d+")
_ADDRESS = re.compile(r"[^:\s]+:\d{1,5}")
LONGEST_BLOCK_MS: Final = 5.0
LONGEST_RESERVE_MS: Final = 10.0
"""Where nothing else is configured."""
START_MS: Final = 20.0
"""The clock runs before the first block comes: a short lead would not hold out so long."""
LEAST_ON_USB_MS: Final = 5.0
"""A USB device is fed by requests that the host schedules, in frames of 1 ms, beside all else
on the bus. Not measured on a device."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Analogue inputs that are wired alike.

    Attributes
    ----------
    channels : tuple of str
        Such as ``("ai0", "ai1")``; their order is that of the columns of what is read.
    range_v : float
        Input range, +/-V at the connector, in (0, 10].
    terminals : str
        How they are wired: default, rse, nrse, differential or pseudo_differential.
    """

    channels: tuple[str, ...]
    range_v: float = 10.0
    terminals: Terminals = "differential"


@dataclass(frozen=True, slots=True)
class InterlockLine:
    """A digital line to the amplifier's interlock: high is allowed, low is off.

    Attributes
    ----------
    line : str
        Such as port0/line0; one that a watchdog of the device covers.
    timeout_ms : float
        The device pulls it low when it was not fed for so long.
    """

    line: str = "port0/line0"
    timeout_ms: float = 200.0


@dataclass(frozen=True, slots=True)
class ServerTls:
    """Certificate files for an encrypted link to NI's gRPC device server (PEM).

    Attributes
    ----------
    authority : Path
        Certificate of the authority that signed the server's.
    certificate : Path or None
        Ours, where the server asks for one; its private key stands beside it, with the suffix
        ``.key``.
    """

    authority: Path
    certificate: Path | None = None


@dataclass(frozen=True, slots=True)
class AuxInput:
    """A further analogue input: anything that is to be recorded in step with the rest.

    Attributes
    ----------
    channel : AnalogueChannel
        Name, unit, and how volts become the unit.
    inputs : Inputs
        The one channel that it is wired to.
    """

    channel: AnalogueChannel
    inputs: Inputs


@dataclass(frozen=True, slots=True)
class NiConfig:
    """One NI device and what is wired to it.

    Attributes
    ----------
    device : str
        Name of the device in NI MAX, such as Dev1.
    output : str
        Analogue output that feeds the amplifier.
    force, accel : Inputs
        Gauges of the force sensor, axes of the accelerometer.
    monitor : Inputs
        The one channel that reads the amplifier's output back.
    aux : tuple of AuxInput
        Further channels.
    amplifier_gain : float
        Screen volts per volt of the output.
    monitor_gain : float
        Screen volts per volt of the monitor channel, for what converts the volts.
    screen_peak_v : float
        Limit of the screen volts; the output task is limited to it too.
    screen_mm : tuple of float
        Width along x, height along y.
    sample_rate_hz : float
        Samples per second of the device's clock.
    block_ms : float or None
        Longest piece that is written or read in one call; None: 5 ms, or the part of the lead
        that is in the device, where that is less.
    lead_ms : float
        From handing a drive over to its playing.
    max_lead_ms : float or None
        To which the lead may grow at an arming after an underrun, from `lead_ms` (never) on;
        None: to 20 ms, or not at all where `lead_ms` is longer.
    reserve_ms : float or None
        How much of the lead is kept out of the device, where a stop can still ramp it down;
        the rest is what a late loop may use up before the output runs dry. None: 10 ms, or a
        third of the lead, where that is less.
    address : str or None
        host:port of NI's gRPC device server; None for the driver of this machine.
    tls : ServerTls or None
        None: the link to the server is not encrypted.
    interlock : InterlockLine or None
        None: no line is driven.
    deadline_s : float
        How long the server may take to answer, beyond what a call waits for samples.

    Raises
    ------
    ConfigError
        If a field is out of its range; the text names it.
    """

    force: Inputs
    accel: Inputs
    monitor: Inputs
    aux: tuple[AuxInput, ...] = ()
    device: str = "Dev1"
    output: str = "ao0"
    amplifier_gain: float = 50.0
    monitor_gain: float = 50.0
    screen_peak_v: float = 75.0
    screen_mm: tuple[float, float] = (70.0, 35.0)
    sample_rate_hz: float = 20_000.0
    block_ms: float | None = None
    lead_ms: float = 30.0
    max_lead_ms: float | None = None
    reserve_ms: float | None = None
    address: str | None = None
    tls: ServerTls | None = None
    interlock: InterlockLine | None = None
    deadline_s: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what cannot be, field by field."""
        for name, low, high in _RANGES:
            if (value := getattr(self, name)) is not None:
                _require_between(name, value, low, high)
        require_max_lead(self.lead_ms, self.max_lead_ms)
        for side_mm in self.screen_mm:
            _require_between("screen_mm", side_mm, 1.0, 1_000.0)
        _require_match("device", self.device, re.compile(r"[^/\s,:]+"), "Dev1")
        _require_match("output", self.output, _OUTPUT, "ao0")
        if self.address is not None:
            _require_match("address", self.address, _ADDRESS, "rig-pc:31763")
        elif self.tls is not None:
            raise ConfigError("tls: certificates are for a server; give its address too")
        if self.interlock is not None:
            self._require_fed(self.interlock)
        for name, inputs in self.groups:
            _require_wired(name, inputs)
        self._require_distinct_channels()
        if len(self.monitor.channels) != 1:
            raise ConfigError(
                f"monitor.channels = {self.monitor.channels}: exactly one channel reads the "
                "amplifier's output back"
            )
        for name, inputs in self.groups[3:]:
            if len(inputs.channels) != 1:
                raise ConfigError(f"{name} = {inputs.channels}: exactly one channel accepted")
        if not self.peak_output_v <= 10.0:
            raise ConfigError(
                f"screen_peak_v = {self.screen_peak_v:g} with amplifier_gain = "
                f"{self.amplifier_gain:g} asks for {self.peak_output_v:g} V at the output: "
                "10 V or less accepted; lower the peak or correct the gain"
            )
        if not self.device_lead_samples >= self.block_samples:
            raise ConfigError(
                f"{self._in_device}, less than a piece of {self._ms(self.block_samples)} that "
                "is written at once: raise lead_ms, or lower reserve_ms or transfer_ms "
                "(block_ms)"
            )

    @property
    def groups(self) -> tuple[tuple[str, Inputs], ...]:
        """Inputs that are wired alike, with their section's name, in the order of reading."""
        fixed = (("force", self.force), ("accel", self.accel), ("monitor", self.monitor))
        more = ((f"aux.{number}", each.inputs) for number, each in enumerate(self.aux))
        return (*fixed, *more)

    @property
    def channels(self) -> tuple[str, ...]:
        """Every input channel, in the order of the rows of what is read."""
        return tuple(channel for _, inputs in self.groups for channel in inputs.channels)

    @property
    def peak_output_v(self) -> float:
        """Largest magnitude of the output, before the amplifier."""
        return self.screen_peak_v / self.amplifier_gain

    @property
    def block_samples(self) -> int:
        """The longest piece of one call, in samples."""
        if self.block_ms is None:
            longest = round(LONGEST_BLOCK_MS * 1e-3 * self.sample_rate_hz)
            return max(min(longest, self.device_lead_samples), 1)
        return max(round(self.block_ms * 1e-3 * self.sample_rate_hz), 1)

    @property
    def lead_samples(self) -> int:
        """The whole lead, in samples."""
        return round(self.lead_ms * 1e-3 * self.sample_rate_hz)

    @property
    def max_lead_samples(self) -> int:
        """The longest lead, in samples."""
        longest_ms = longest_lead_ms(self.lead_ms, self.max_lead_ms)
        return round(longest_ms * 1e-3 * self.sample_rate_hz)

    @property
    def reserve_samples(self) -> int:
        """The part of the lead that is kept out of the device."""
        reserve_ms = self.reserve_ms
        if reserve_ms is None:
            reserve_ms = min(LONGEST_RESERVE_MS, self.lead_ms / 3.0)
        return round(reserve_ms * 1e-3 * self.sample_rate_hz)

    @property
    def device_lead_samples(self) -> int:
        """The part of the lead that is in the device and can no longer be changed."""
        return self.lead_samples - self.reserve_samples

    @property
    def max_device_lead_samples(self) -> int:
        """The same of the longest lead."""
        return self.max_lead_samples - self.reserve_samples

    @property
    def start_samples(self) -> int:
        """Zeros that are at least in the device when its clock starts."""
        return round(START_MS * 1e-3 * self.sample_rate_hz)

    @property
    def buffer_samples(self) -> int:
        """The output's buffer in the computer: what is written in advance, twice."""
        longest = max(self.start_samples, self.max_device_lead_samples)
        return 2 * (longest + self.block_samples)

    @property
    def too_short_for_usb(self) -> str | None:
        """What is wrong with the lead on a device on USB; None: nothing."""
        least = round(LEAST_ON_USB_MS * 1e-3 * self.sample_rate_hz)
        if self.device_lead_samples >= least:
            return None
        return (
            f"{self._in_device} {self.device!r}, which is on USB: at least "
            f"{LEAST_ON_USB_MS:g} ms accepted there; raise lead_ms, or lower reserve_ms"
        )

    @property
    def _in_device(self) -> str:
        """Return how much of the lead is in the device, and why."""
        return (
            f"lead_ms = {self.lead_ms:g} less reserve_ms = {self._ms(self.reserve_samples)} "
            f"leaves {self._ms(self.device_lead_samples)} in the device"
        )

    def _ms(self, n_samples: int) -> str:
        return f"{1e3 * n_samples / self.sample_rate_hz:.3g} ms"

    def _require_fed(self, interlock: InterlockLine) -> None:
        _require_match("interlock.line", interlock.line, _LINE, "port0/line0")
        _require_between("interlock.timeout_ms", interlock.timeout_ms, 10.0, 10_000.0)
        # A call waits for its samples as long as there are any to play.
        longest_ms = longest_lead_ms(self.lead_ms, self.max_lead_ms)
        waits_ms = longest_ms + 1e3 * self.block_samples / self.sample_rate_hz
        if interlock.timeout_ms <= waits_ms:
            raise ConfigError(
                f"interlock.timeout_ms = {interlock.timeout_ms:g}: more than the longest lead "
                f"and a block together, {waits_ms:g}, is accepted; it would end what goes well"
            )

    def _require_distinct_channels(self) -> None:
        seen: dict[str, str] = {}
        for group, inputs in self.groups:
            for channel in inputs.channels:
                if channel in seen:
                    raise ConfigError(
                        f"{group}.channels: {channel} is also in {seen[channel]}.channels; "
                        "a channel has one use"
                    )
                seen[channel] = group


_RANGES = (
    ("amplifier_gain", 1e-3, 1e4),
    ("monitor_gain", 1e-3, 1e5),
    ("screen_peak_v", 1e-3, 75.0),
    ("sample_rate_hz", 1_000.0, 200_000.0),
    ("block_ms", 0.05, 100.0),
    ("lead_ms", 1.0, 1_000.0),
    ("max_lead_ms", 1.0, 1_000.0),
    ("reserve_ms", 0.0, 1_000.0),
    ("deadline_s", 0.01, 60.0),
)


def _require_between(name: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise ConfigError(f"{name} = {value}: {low:g} to {high:g} accepted")


def _require_match(name: str, value: str, pattern: re.Pattern[str], example: str) -> None:
    if not pattern.fullmatch(value):
        raise ConfigError(f"{name} = {value!r}: something like {example!r} accepted")


def _require_wired(name: str, inputs: Inputs) -> None:
    if not inputs.channels:
        raise ConfigError(f"{name}.channels is empty: at least one channel, such as ai0")
    for channel in inputs.channels:
        _require_match(f"{name}.channels", channel, _CHANNEL, "ai0")
    _require_between(f"{name}.range_v", inputs.range_v, 1e-3, 10.0)
    if inputs.terminals not in get_args(Terminals):
        raise ConfigError(
            f"{name}.terminals = {inputs.terminals!r}: one of {', '.join(get_args(Terminals))}"
        )
