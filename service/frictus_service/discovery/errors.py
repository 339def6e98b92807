"""Errors of discovery; all are also the natural builtin."""

from frictus_service.errors import ServiceError


class UnknownCauseError(ServiceError, KeyError):
    """The catalogue has no cause of this id; the text lists those it has."""

    def __str__(self) -> str:
        """Return the text as it is: KeyError would put it in quotes."""
        return str(self.args[0])


class BaseModelError(ServiceError, ValueError):
    """There is no such base model, or it is not of the response that is asked for."""


class DesignError(ServiceError, ValueError):
    """There is no such design, or its trials cannot be planned with."""


class DiscoveryCancelledError(ServiceError, RuntimeError):
    """Somebody ended the discovery."""


class DiscoveryJobError(ServiceError):
    """Base of what is wrong with a request about discoveries."""


class UnknownStudyError(DiscoveryJobError, LookupError):
    """The folder of studies has no such file; the text lists some it has."""


class UnknownDiscoveryError(DiscoveryJobError, LookupError):
    """There is no discovery of this id."""


class DiscoveryStateError(DiscoveryJobError, RuntimeError):
    """The discovery is in a state that does not allow this; the text names it."""
