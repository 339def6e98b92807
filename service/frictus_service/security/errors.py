"""What goes wrong with certificates on disk."""

from frictus_service.errors import ServiceError


class SecurityError(ServiceError):
    """Base of every error of this package."""


class MemberNameError(SecurityError, ValueError):
    """A role or name that no certificate can bear."""


class CertificateFileError(SecurityError, ValueError):
    """A file holds no certificate or key of ours; the text says which and why."""


class WouldOverwriteError(SecurityError, FileExistsError):
    """A certificate or key of that name is there already."""
