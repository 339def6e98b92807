"""Every error the service raises on purpose; each is also the natural builtin."""


class ServiceError(Exception):
    """Base of every error of this package."""


class ConfigurationError(ServiceError, ValueError):
    """The configuration file cannot be used; the text gives the file and the line at fault."""


class StartError(ServiceError, RuntimeError):
    """A part of the service did not start; the text says which and why."""
