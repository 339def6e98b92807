"""What is installed and configured, and whether router, rigs and device answer.

What a lead costs in rendering is from the table of `docs/lead.md`, of the simulated rig: free
strokes, every sensor used, compensated. `bench/lead.py` measures it anew; a test holds these
figures to the document.
"""

import importlib.metadata
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

import frictus
from frictus.errors import ArgumentError, CertificateError, LinkError
from frictus.messages import RigStatus
from frictus_hardware import BackendConfig, NiRigConfig
from frictus_hardware.errors import DriverMissingError, HardwareError
from frictus_hardware.nidaq.assembly import conversion_of
from frictus_hardware.nidaq.devices import INSTALL, mismatches, survey
from frictus_hardware.nidaq.settings import NeonodeSettings
from frictus_hardware.sensors.hid import HidPort
from frictus_service.cli.checks import storage_checks
from frictus_service.cli.checks.machine_checks import (
    DoctorCheck,
    clock_resolution,
    clock_synchronised,
    disk_rate,
    real_time_priority,
    timer_lateness,
)
from frictus_service.config import Config, SecurityConfig
from frictus_service.config_file import load
from frictus_service.errors import ConfigurationError
from frictus_service.selftest.playing import least_lead_ms


class LeadCost(NamedTuple):
    """How far off the rendered finger and friction are at a lead.

    Attributes
    ----------
    lead_ms : float
        From handing a drive over to its playing.
    position_mm : float
        Rms of where the finger is rendered, against where it is.
    bands_db : float
        Friction at the screen against the target, in third octaves, dB rms.
    """

    lead_ms: float
    position_mm: float
    bands_db: float


MEASURED: Final = (
    LeadCost(2.0, 0.173, 0.454),
    LeadCost(5.0, 0.181, 0.448),
    LeadCost(10.0, 0.194, 0.480),
    LeadCost(15.0, 0.209, 0.486),
    LeadCost(20.0, 0.225, 0.493),
    LeadCost(30.0, 0.270, 0.532),
)
"""In the order of the lead."""


def lead_cost(lead_ms: float) -> LeadCost | None:
    """Return what a lead costs, linear between those measured; None beyond them.

    Parameters
    ----------
    lead_ms : float
        From handing a drive over to its playing.
    """
    leads_ms, positions_mm, bands_db = zip(*MEASURED, strict=True)
    if not leads_ms[0] <= lead_ms <= leads_ms[-1]:
        return None
    return LeadCost(
        lead_ms,
        float(np.interp(lead_ms, leads_ms, positions_mm)),
        float(np.interp(lead_ms, leads_ms, bands_db)),
    )


NEEDED: Final = (
    "eclipse-zenoh",
    "numpy",
    "pydantic",
    "fastapi",
    "uvicorn",
    "numba",
    "scipy",
    "prometheus-client",
    "rich",
    "typer",
)


def python_version() -> DoctorCheck:
    """Look at the interpreter."""
    return DoctorCheck("python", "ok", f"{sys.version.split()[0]} on {sys.platform}")


def packages(needed: tuple[str, ...] = NEEDED) -> DoctorCheck:
    """Look for the packages that the service needs."""
    missing = []
    for name in needed:
        try:
            importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    if missing:
        to_do = "pip install 'frictus[service]'"
        return DoctorCheck("packages", "fail", f"missing: {', '.join(missing)}", to_do)
    return DoctorCheck("packages", "ok", f"all {len(needed)} are installed")


def compiler_cache() -> DoctorCheck:
    """See whether compiled code can be kept: without, every start takes seconds longer."""
    from frictus_service.synthesis.kernel import target_friction

    folder = Path(str(target_friction.stats.cache_path))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        to_do = "set NUMBA_CACHE_DIR to a folder that can be written"
        return DoctorCheck(
            "compiled code", "warn", f"{folder} cannot be written: {error}", to_do
        )
    return DoctorCheck("compiled code", "ok", f"is kept in {folder}")


def configuration(path: Path | None) -> tuple[Config | None, DoctorCheck]:
    """Read the configuration; None if it cannot be used."""
    try:
        config = load(path)
    except ConfigurationError as error:
        return None, DoctorCheck("configuration", "fail", str(error), "correct the lines named")
    where = path or "frictus.toml or the defaults"
    return config, DoctorCheck(
        "configuration", "ok", f"{where}: rig {config.rig} at {config.site}"
    )


def rig_files(config: Config) -> Iterator[DoctorCheck]:
    """See whether the files are here that the rig is made from, where it runs here."""
    for key, file in config.rig_files.items():
        if not file.is_file():
            dotted = ".".join(map(str, key))
            to_do = "put it there, or correct the key, where the rig runs on this machine"
            yield DoctorCheck("rig files", "warn", f"{dotted}: there is no file {file}", to_do)


def library_folder(folder: Path) -> DoctorCheck:
    """See whether the texture library can be read, file by file."""
    from frictus_service.library import DamagedTextureError, TextureLibrary

    library = TextureLibrary(folder)
    damaged = []
    names = library.names()
    for name in names:
        try:
            library.get(name)
        except DamagedTextureError:
            damaged.append(name)
    if damaged:
        found = f"{len(damaged)} of {len(names)} files are damaged: {', '.join(damaged)}"
        return DoctorCheck("textures", "warn", found, f"replace or delete them in {folder}")
    return DoctorCheck(
        "textures", "ok", f"{len(names)} in the library, those shipped among them"
    )


ANSWER_S: Final = 1.0


def router_and_rigs(
    endpoint: str, security: SecurityConfig | None = None
) -> Iterator[DoctorCheck]:
    """Look for the router, and for rigs behind it."""
    try:
        tls = None if security is None else security.of("client")
        with frictus.connect(endpoint, timeout_s=ANSWER_S, tls=tls) as client:
            yield DoctorCheck("router", "ok", f"answers at {endpoint}")
            rigs = client.rigs()
            for rig in rigs:
                yield _rig(client, rig)
    except (CertificateError, ConfigurationError) as error:
        yield DoctorCheck("router", "fail", str(error), "see docs/security.md")
        return
    except ArgumentError as error:
        yield DoctorCheck("router", "fail", str(error), "correct the --router")
        return
    except LinkError as error:
        yield DoctorCheck(
            "router", "warn", str(error), "start `frictus serve`, or name its --router"
        )
        return
    if not rigs:
        to_do = "start `frictus serve` or `frictus rig`"
        yield DoctorCheck("rigs", "warn", "none is present", to_do)


def _rig(client: frictus.Client, which: frictus.RigName) -> DoctorCheck:
    name = f"rig {which.name} at {which.site}"
    try:
        status = client.rig(which.name, which.site).status()
    except (frictus.FrictusError, OSError) as error:
        return DoctorCheck(
            name, "fail", str(error), "look at the output of its `frictus serve`"
        )
    found = f"{status.state}, {status.backend}, version {status.version}, {_lead(status)}"
    if status.fault is not None:
        return DoctorCheck(name, "fail", f"{found}: {status.fault.reason}", status.fault.action)
    if status.model_placeholder:
        to_do = "measure and set a model; until then friction is not true to scale"
        return DoctorCheck(name, "warn", f"{found}, with a placeholder model", to_do)
    return DoctorCheck(name, "ok", found)


def _lead(status: RigStatus) -> str:
    """Return how much of its lead a rig has used lately, which would do, and what it costs."""
    used_ms = status.lead_ms - status.timing.margin_min_ms
    times = status.counters.lead_growths
    grown = f" (grown {'once' if times == 1 else f'{times} times'})" if times else ""
    said = f"lead {status.lead_ms:g} ms{grown}, of which it lately used {used_ms:.1f} at most"
    would_do_ms = least_lead_ms(status.lead_ms, status.timing.margin_min_ms)
    shorter_ms = would_do_ms if would_do_ms < status.lead_ms else None
    if shorter_ms is not None:
        said = f"{said}: {shorter_ms:g} would do"
    return f"{said}; {cost_of(status.lead_ms, shorter_ms)}"


def cost_of(lead_ms: float, shorter_ms: float | None) -> str:
    """Return what a lead costs on the simulated rig, beside a shorter one that would do.

    Parameters
    ----------
    lead_ms : float
        In force.
    shorter_ms : float or None
        None: no shorter one would do.
    """
    cost = lead_cost(lead_ms)
    if cost is None:
        first, last = MEASURED[0].lead_ms, MEASURED[-1].lead_ms
        return f"what it costs was measured from {first:g} to {last:g} ms (docs/lead.md)"
    said = f"it renders free strokes to {cost.bands_db:.2f} dB and {cost.position_mm:.2f} mm"
    less = None if shorter_ms is None else lead_cost(shorter_ms)
    if less is not None:
        said += f", with {less.lead_ms:g} ms to {less.bands_db:.2f} and {less.position_mm:.2f}"
    return f"{said} (rms on the simulated rig, docs/lead.md)"


def device_checks(backend: BackendConfig) -> Iterator[DoctorCheck]:
    """Look at driver, device and touch sensor, if the rig is on an NI device; drive nothing."""
    if not isinstance(backend, NiRigConfig):
        return
    yield from ni_device(backend)
    yield sensors(backend)
    if isinstance(backend.touch, NeonodeSettings):
        yield touch_sensor(backend.touch)


def ni_device(backend: NiRigConfig) -> Iterator[DoctorCheck]:
    """Compare what the driver says of its devices with the configuration."""
    try:
        package = importlib.metadata.version("nidaqmx")
        found = survey(backend.wiring)
    except (importlib.metadata.PackageNotFoundError, DriverMissingError) as error:
        to_do = f"{INSTALL}, and the NI-DAQmx driver from ni.com, or an address"
        yield DoctorCheck("driver", "fail", str(error), to_do)
        return
    except HardwareError as error:
        yield DoctorCheck(
            "driver", "fail", str(error), "see backend.address and the device server"
        )
        return
    where = "on this machine" if backend.address is None else f"at {backend.address}"
    told = f"NI-DAQmx {found.driver} {where}, package nidaqmx {package}"
    yield DoctorCheck("driver", "ok", told)
    present = ", ".join(found.devices) or "none"
    if found.facts is None:
        text = f"backend.device = {backend.device!r} is not there; present: {present}"
        to_do = "correct backend.device, or see the device in NI MAX"
        yield DoctorCheck("device", "fail", text, to_do)
        return
    yield DoctorCheck(
        "device", "ok", f"{backend.device} is a {found.facts.product}; present: {present}"
    )
    faults = mismatches(backend.wiring, found.facts)
    if faults:
        text = "; ".join(f"backend.{fault}" for fault in faults)
        yield DoctorCheck("wiring", "fail", text, "correct these lines of the configuration")
        return
    text = f"{len(backend.wiring.channels)} inputs and {backend.output} fit the device"
    yield DoctorCheck("wiring", "ok", text)


def sensors(backend: NiRigConfig) -> DoctorCheck:
    """See whether the calibration can be read and the sensors fit their channels."""
    try:
        conversion_of(backend)
    except HardwareError as error:
        return DoctorCheck(
            "sensors", "fail", str(error), "correct backend.force or backend.accel"
        )
    found = f"{backend.force.calibration.name} is a calibration, and the channels fit it"
    return DoctorCheck("sensors", "ok", found)


def touch_sensor(touch: NeonodeSettings) -> DoctorCheck:
    """See whether the touch sensor is plugged in and may be opened."""
    port = HidPort(serial_number=touch.serial_number)
    try:
        port.open()
    except DriverMissingError as error:
        return DoctorCheck("touch sensor", "fail", str(error), "install the package named")
    except HardwareError as error:
        return DoctorCheck("touch sensor", "fail", str(error), "see what the reason names")
    port.close()
    return DoctorCheck("touch sensor", "ok", "is plugged in and can be opened")


def all_checks(config_file: Path | None, router: str | None) -> Iterator[DoctorCheck]:
    """Make every check, one after another."""
    yield python_version()
    yield packages()
    yield compiler_cache()
    config, found = configuration(config_file)
    yield found
    settings = config or Config()
    if config is not None:
        yield from rig_files(config)
        yield library_folder(config.textures)
        yield from device_checks(config.backend)
        yield from storage_checks.folders(config)
        yield from storage_checks.registry(config)
        yield disk_rate(config.recordings, config.sample_rate_hz)
    yield from router_and_rigs(router or settings.router.endpoint, settings.security)
    yield clock_resolution()
    yield timer_lateness()
    yield real_time_priority()
    yield clock_synchronised()
