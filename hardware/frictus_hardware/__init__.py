"""The rig: one interface, its backends, and the physics of finger and screen."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from frictus_hardware.base import Backend, Exchange, RigInfo, TouchReport, Truth
from frictus_hardware.nidaq.settings import NiRigConfig
from frictus_hardware.replay.tape import ReplayConfig
from frictus_hardware.simulated.config import SimulatedConfig, SimulatedDeviceConfig

__all__ = [
    "Backend",
    "BackendConfig",
    "Exchange",
    "NiRigConfig",
    "ReplayConfig",
    "RigInfo",
    "SimulatedConfig",
    "SimulatedDeviceConfig",
    "TouchReport",
    "Truth",
    "located",
    "make_backend",
    "open_backend",
    "reset_device",
]

BackendConfig = Annotated[
    SimulatedConfig | SimulatedDeviceConfig | NiRigConfig | ReplayConfig,
    Field(discriminator="kind"),
]


def located(config: BackendConfig, folder: Path) -> BackendConfig:
    """Return the configuration with relative files made relative to `folder`.

    Parameters
    ----------
    config : BackendConfig
        Which rig, and how it is reached.
    folder : Path
        That relative paths are relative to.
    """
    return config.within(folder) if isinstance(config, NiRigConfig | ReplayConfig) else config


def make_backend(config: BackendConfig) -> Backend:
    """Return the configured rig, not yet open: its sample clock starts with `open`.

    Parameters
    ----------
    config : BackendConfig
        Which rig, and how it is reached.
    """
    # Backends are imported late: a process that only reads a configuration needs none of them.
    if isinstance(config, SimulatedConfig):
        from frictus_hardware.simulated.rig import SimulatedRig

        return SimulatedRig(config)
    if isinstance(config, NiRigConfig):
        from frictus_hardware.nidaq.assembly import make_rig

        return make_rig(config)
    if isinstance(config, ReplayConfig):
        from frictus_hardware.replay.rig import ReplayRig
        from frictus_hardware.replay.tape import read_tape

        return ReplayRig(config, read_tape(config.file))
    from frictus_hardware.simulated.device_rig import SimulatedDeviceRig

    return SimulatedDeviceRig(config)


def open_backend(config: BackendConfig) -> Backend:
    """Return the configured rig, open and disarmed; have all else ready, its clock runs.

    Parameters
    ----------
    config : BackendConfig

    Raises
    ------
    ConfigError
        If the configuration does not fit the device.
    LinkLostError
        If the device cannot be reached.
    """
    backend = make_backend(config)
    backend.open()
    return backend


def reset_device(config: BackendConfig) -> None:
    """Bring the output of a device to zero after the process that drove it has died.

    A rig simulated inside that process has died with it.

    Raises
    ------
    HardwareError
        If the device cannot be reached.
    """
    if isinstance(config, SimulatedDeviceConfig):
        from frictus_hardware.simulated.device_rig import reset

        reset(config)
    elif isinstance(config, NiRigConfig):
        from frictus_hardware.nidaq.assembly import reset as reset_ni

        reset_ni(config.wiring)
