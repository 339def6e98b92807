"""The NI device and the touch sensor of the configured rig."""

import importlib.metadata
from collections.abc import Iterator

from frictus_hardware import BackendConfig, NiRigConfig
from frictus_hardware.errors import DriverMissingError, HardwareError
from frictus_hardware.nidaq.assembly import conversion_of
from frictus_hardware.nidaq.devices import INSTALL, mismatches, survey
from frictus_hardware.nidaq.settings import NeonodeSettings
from frictus_hardware.sensors.hid import HidPort
from frictus_service.cli.checks.check import Check


def device_checks(backend: BackendConfig) -> Iterator[Check]:
    """Look at driver, device and touch sensor, if the rig is on an NI device; drive nothing."""
    if not isinstance(backend, NiRigConfig):
        return
    yield from ni_device(backend)
    yield sensors(backend)
    if isinstance(backend.touch, NeonodeSettings):
        yield touch_sensor(backend.touch)


def ni_device(backend: NiRigConfig) -> Iterator[Check]:
    """Compare what the driver says of its devices with the configuration."""
    try:
        package = importlib.metadata.version("nidaqmx")
        found = survey(backend.wiring)
    except (importlib.metadata.PackageNotFoundError, DriverMissingError) as error:
        to_do = f"{INSTALL}, and the NI-DAQmx driver from ni.com, or an address"
        yield Check("driver", "fail", str(error), to_do)
        return
    except HardwareError as error:
        yield Check("driver", "fail", str(error), "see backend.address and the device server")
        return
    where = "on this machine" if backend.address is None else f"at {backend.address}"
    told = f"NI-DAQmx {found.driver} {where}, package nidaqmx {package}"
    yield Check("driver", "ok", told)
    present = ", ".join(found.devices) or "none"
    if found.facts is None:
        text = f"backend.device = {backend.device!r} is not there; present: {present}"
        to_do = "correct backend.device, or see the device in NI MAX"
        yield Check("device", "fail", text, to_do)
        return
    yield Check(
        "device", "ok", f"{backend.device} is a {found.facts.product}; present: {present}"
    )
    faults = mismatches(backend.wiring, found.facts)
    if faults:
        text = "; ".join(f"backend.{fault}" for fault in faults)
        yield Check("wiring", "fail", text, "correct these lines of the configuration")
        return
    text = f"{len(backend.wiring.channels)} inputs and {backend.output} fit the device"
    yield Check("wiring", "ok", text)


def sensors(backend: NiRigConfig) -> Check:
    """See whether the calibration can be read and the sensors fit their channels."""
    try:
        conversion_of(backend)
    except HardwareError as error:
        return Check("sensors", "fail", str(error), "correct backend.force or backend.accel")
    found = f"{backend.force.calibration.name} is a calibration, and the channels fit it"
    return Check("sensors", "ok", found)


def touch_sensor(touch: NeonodeSettings) -> Check:
    """See whether the touch sensor is plugged in and may be opened."""
    port = HidPort(serial_number=touch.serial_number)
    try:
        port.open()
    except DriverMissingError as error:
        return Check("touch sensor", "fail", str(error), "install the package named")
    except HardwareError as error:
        return Check("touch sensor", "fail", str(error), "see what the reason names")
    port.close()
    return Check("touch sensor", "ok", "is plugged in and can be opened")
