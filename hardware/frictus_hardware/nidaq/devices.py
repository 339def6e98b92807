"""What the driver says of its devices, and where the configuration asks for something else."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from frictus_hardware.errors import DriverMissingError
from frictus_hardware.nidaq.config import Inputs, NiConfig, Terminals

INSTALL: Final = 'pip install "frictus[ni]"'
BANK: Final = 16
PAIR: Final = 8
"""On a multiplexed device a differential ai0 takes the leads of ai0 and ai8, and so on."""

_NAMES: Final[dict[str, Terminals]] = {
    "RSE": "rse",
    "NRSE": "nrse",
    "DIFF": "differential",
    "PSEUDO_DIFF": "pseudo_differential",
}


@dataclass(frozen=True, slots=True)
class DeviceFacts:
    """What a device offers.

    Attributes
    ----------
    product : str
        Such as PCIe-6323.
    inputs, outputs : tuple of str
        Such as ``("ai0", "ai1")``.
    terminals : mapping of str to tuple of str
        What each configured input that is there can be wired as.
    input_peak_v, output_peak_v : float
        Largest range; 0 without such channels.
    input_rate_hz : float
        Conversions per second: of one channel if simultaneous, of all together otherwise.
    output_rate_hz : float
        Largest of the analogue output.
    simultaneous : bool
        Whether each input has a converter of its own.
    usb : bool
        Whether it is on USB, which needs a longer lead.
    """

    product: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    terminals: Mapping[str, tuple[str, ...]]
    input_peak_v: float
    output_peak_v: float
    input_rate_hz: float
    output_rate_hz: float
    simultaneous: bool
    usb: bool = False


@dataclass(frozen=True, slots=True)
class Survey:
    """What a driver knows.

    Attributes
    ----------
    driver : str
        Version of NI-DAQmx.
    devices : tuple of str
        Names of all devices.
    facts : DeviceFacts or None
        Of the configured device; None if it is not there.
    """

    driver: str
    devices: tuple[str, ...]
    facts: DeviceFacts | None


def mismatches(config: NiConfig, facts: DeviceFacts) -> tuple[str, ...]:
    """Return where a configuration asks for what a device does not offer.

    Parameters
    ----------
    config : NiConfig
        The device and what is wired to it.
    facts : DeviceFacts

    Returns
    -------
    tuple of str
        Each names the line of the configuration.
    """
    return (
        *(text for name, wired in config.groups for text in _of_inputs(name, wired, facts)),
        *_shared_leads(config, facts),
        *_of_output(config, facts),
        *_of_rate(config, facts),
        *_of_bus(config, facts),
    )


def _of_bus(config: NiConfig, facts: DeviceFacts) -> Iterator[str]:
    wrong = config.too_short_for_usb
    if facts.usb and wrong is not None:
        yield wrong


def _of_inputs(name: str, inputs: Inputs, facts: DeviceFacts) -> Iterator[str]:
    missing = [channel for channel in inputs.channels if channel not in facts.inputs]
    if missing:
        yield (
            f"{_key(name)} = {list(inputs.channels)}: {facts.product} has no "
            f"{', '.join(missing)}; it has {_span(facts.inputs)}"
        )
    if not inputs.range_v <= facts.input_peak_v:
        yield (
            f"{name}.range_v = {inputs.range_v:g}: the inputs of {facts.product} go to "
            f"{facts.input_peak_v:g} V"
        )
    if inputs.terminals == "default":
        return
    for channel in inputs.channels:
        offered = facts.terminals.get(channel)
        if offered is not None and inputs.terminals not in offered:
            yield (
                f"{name}.terminals = {inputs.terminals!r}: {channel} of {facts.product} can be "
                f"{', '.join(offered)}"
            )


def _shared_leads(config: NiConfig, facts: DeviceFacts) -> Iterator[str]:
    """Find channels that are the other lead of a differential one."""
    if facts.simultaneous:
        return
    used = {channel: name for name, inputs in config.groups for channel in inputs.channels}
    for name, inputs in config.groups:
        if inputs.terminals != "differential":
            continue
        for channel in inputs.channels:
            number = int(channel.removeprefix("ai"))
            other = f"ai{number + PAIR}"
            if number % BANK < PAIR and other in used:
                yield (
                    f"{_key(used[other])}: {other} is the second lead of the differential "
                    f"{channel} in {_key(name)}; use another channel"
                )


def _of_output(config: NiConfig, facts: DeviceFacts) -> Iterator[str]:
    if config.output not in facts.outputs:
        has = _span(facts.outputs) if facts.outputs else "no analogue output"
        yield f"output = {config.output!r}: {facts.product} has {has}"
    elif not config.peak_output_v <= facts.output_peak_v:
        yield (
            f"screen_peak_v = {config.screen_peak_v:g} with amplifier_gain = "
            f"{config.amplifier_gain:g}: {config.peak_output_v:g} V at an output that goes to "
            f"{facts.output_peak_v:g} V"
        )


def _of_rate(config: NiConfig, facts: DeviceFacts) -> Iterator[str]:
    channels = 1 if facts.simultaneous else len(config.channels)
    if not config.sample_rate_hz * channels <= facts.input_rate_hz:
        yield (
            f"sample_rate_hz = {config.sample_rate_hz:g}: the inputs of {facts.product} make "
            f"{facts.input_rate_hz / channels:g} Hz with {len(config.channels)} channels"
        )
    if facts.outputs and not config.sample_rate_hz <= facts.output_rate_hz:
        yield (
            f"sample_rate_hz = {config.sample_rate_hz:g}: the output of {facts.product} makes "
            f"{facts.output_rate_hz:g} Hz"
        )


def _key(name: str) -> str:
    one = name == "monitor" or name.startswith("aux.")
    return f"{name}.channel" if one else f"{name}.channels"


def _span(channels: tuple[str, ...]) -> str:
    return f"{channels[0]} to {channels[-1]}" if channels else "no such channels"


def survey(config: NiConfig) -> Survey:
    """Ask the driver of this machine, or that behind `config.address`; nothing is driven.

    Parameters
    ----------
    config : NiConfig

    Raises
    ------
    DriverMissingError
        If the package or the driver is not installed.
    ConfigError, DeviceLostError, LinkLostError
        If the driver or its server does not answer.
    """
    try:
        from frictus_hardware.nidaq.driver import Driver
    except ModuleNotFoundError as error:
        raise DriverMissingError(f"{error}: install it with {INSTALL}") from error
    driver = Driver(config)
    try:
        with driver.typed("asking the driver"):
            return _asked(config, driver.options)
    finally:
        driver.close()


def _asked(config: NiConfig, options: Any) -> Survey:
    from nidaqmx.system import System

    system = System(options)
    version = system.driver_version
    names = tuple(system.devices.device_names)
    facts = _facts(config, options) if config.device in names else None
    return Survey(".".join(str(part) for part in version), names, facts)


def _facts(config: NiConfig, options: Any) -> DeviceFacts:
    from nidaqmx.system import Device, PhysicalChannel

    device = Device(config.device, grpc_options=options)
    inputs = _without_device(device.ai_physical_chans.channel_names)
    outputs = _without_device(device.ao_physical_chans.channel_names)
    terminals = {
        channel: _terminals(
            PhysicalChannel(f"{config.device}/{channel}", grpc_options=options).ai_term_cfgs
        )
        for channel in config.channels
        if channel in inputs
    }
    return DeviceFacts(
        product=device.product_type,
        inputs=inputs,
        outputs=outputs,
        terminals=terminals,
        input_peak_v=max(device.ai_voltage_rngs, default=0.0) if inputs else 0.0,
        output_peak_v=max(device.ao_voltage_rngs, default=0.0) if outputs else 0.0,
        input_rate_hz=device.ai_max_multi_chan_rate if inputs else 0.0,
        output_rate_hz=device.ao_max_rate if outputs else 0.0,
        simultaneous=device.ai_simultaneous_sampling_supported if inputs else False,
        usb=is_on_usb(device),
    )


def is_on_usb(device: Any) -> bool:
    """Return whether a device of nidaqmx is on USB; raises what nidaqmx raises."""
    from nidaqmx.constants import BusType

    try:
        return bool(device.bus_type == BusType.USB)
    except ValueError:  # a bus that the package does not know yet
        return False


def _without_device(names: list[str]) -> tuple[str, ...]:
    return tuple(name.rpartition("/")[2] for name in names)


def _terminals(configurations: list[Any]) -> tuple[str, ...]:
    """Return the configurations by the names that a configuration file has for them."""
    return tuple(_NAMES[constant.name] for constant in configurations)
