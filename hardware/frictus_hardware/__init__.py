"""The rig: one interface, its backends, and the physics of finger and screen."""

from typing import Annotated

from pydantic import Field

from frictus_hardware.base import Backend, Exchange, RigConfig, RigInfo, TouchReport, Truth
from frictus_hardware.nidaq.settings import NiRigConfig
from frictus_hardware.replay.tape import ReplayConfig
from frictus_hardware.simulated.config import SimulatedConfig, SimulatedDeviceConfig

__all__ = [
    "Backend",
    "BackendConfig",
    "Exchange",
    "NiRigConfig",
    "ReplayConfig",
    "RigConfig",
    "RigInfo",
    "SimulatedConfig",
    "SimulatedDeviceConfig",
    "TouchReport",
    "Truth",
]

BackendConfig = Annotated[
    SimulatedConfig | SimulatedDeviceConfig | NiRigConfig | ReplayConfig,
    Field(discriminator="kind"),
]
