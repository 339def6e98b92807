"""What the registry refuses, and how it fails."""

from frictus_service.errors import ServiceError


class RegistryError(ServiceError):
    """Base of every error of the registry."""


class RegistryNameError(RegistryError, ValueError):
    """A name, alias or reference that nothing in the registry can have."""


class ProvenanceError(RegistryError, ValueError):
    """A model does not say where it comes from, and is not published."""


class ComparisonError(RegistryError, ValueError):
    """Two models have no parameters in common."""


class UnknownModelError(RegistryError, LookupError):
    """There is no such model, version or alias."""


class UnknownCalibrationError(RegistryError, LookupError):
    """There is no such calibration."""


class AliasConflictError(RegistryError, RuntimeError):
    """The alias does not stand where the caller saw it."""


class KeyReusedError(RegistryError, ValueError):
    """An idempotency key came with a different request before."""


class CalibrationStateError(RegistryError, RuntimeError):
    """A calibration is in a state that does not allow this."""


class RigBusyError(RegistryError, RuntimeError):
    """A calibration is under way on this rig."""


class RegistryUnavailableError(RegistryError, ConnectionError):
    """The database cannot be reached or opened, or stayed locked."""
