"""The fault taxonomy of a rig: every error a backend raises on purpose."""

from typing import ClassVar


class HardwareError(Exception):
    """Base of every fault. `kind` is the row of the fault table it belongs to."""

    kind: ClassVar[str] = "internal"


class ConfigError(HardwareError, ValueError):
    """The configuration does not fit the device; refuse to start."""

    kind = "config"


class DriverMissingError(ConfigError, ModuleNotFoundError):
    """The vendor package is not installed; the text gives the command that installs it."""


class UnknownEffectError(ConfigError, LookupError):
    """No effect of this id is known; the text names those that are."""


class EffectParameterError(ConfigError):
    """A parameter of an effect is missing, unknown or out of its range."""


class UnsafeDriveError(ConfigError):
    """A drive that is not finite; nothing was output."""


class NotArmedError(HardwareError, RuntimeError):
    """A drive other than zero while the output is not armed; nothing was output."""

    kind = "safety"


class ClosedError(HardwareError, RuntimeError):
    """The backend is not open."""


class BackendError(HardwareError, RuntimeError):
    """A backend returned what none may; nothing of the block is used."""


class TransientError(HardwareError, TimeoutError):
    """A read or write that may be tried again within the lead."""

    kind = "transient"


class StreamLostError(HardwareError, RuntimeError):
    """Samples were lost; the streams must be started anew."""

    kind = "stream_lost"


class UnderrunError(StreamLostError):
    """The output ran dry, which stopped the device; the streams must be started anew."""


class DeviceLostError(HardwareError, OSError):
    """The device is gone or was reset by someone else."""

    kind = "device_lost"


class LinkLostError(HardwareError, ConnectionError):
    """The link to a remote device is gone."""

    kind = "link_lost"


class SensorError(HardwareError, RuntimeError):
    """A sensor is missing, saturated or stale."""

    kind = "sensor"


class SafetyError(HardwareError, RuntimeError):
    """What was measured contradicts what was commanded, or exceeds a limit."""

    kind = "safety"
