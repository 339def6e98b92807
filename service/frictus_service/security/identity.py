"""What the parts of a service present: checked when they start, not when they first connect."""

from frictus.tls import Tls
from frictus_service.config import Config
from frictus_service.errors import ConfigurationError
from frictus_service.security.members import Member


def tls_of_rig(config: Config) -> Tls | None:
    """Return what the configured rig and its recorder present; None without certificates.

    It must be that rig's own: under another name nobody would hear it.

    Parameters
    ----------
    config : Config
        Its site, rig and security section are used.

    Raises
    ------
    ConfigurationError
        If there is no certificate, or it is not this rig's.
    MemberNameError
        If no certificate can bear the rig's name.
    CertificateError
        If it cannot be used.
    """
    tls = config.tls("rig")
    if tls is None:
        return None
    due, name = Member("rig", f"{config.site}/{config.rig}").common_name, tls.name()
    if name != due:
        raise ConfigurationError(
            f"security.rig: {tls.certificate} is of {name!r}, and this is {due!r}: the router "
            f"would drop all that it says; `frictus pki issue rig {config.site}/{config.rig}` "
            "makes its own"
        )
    return tls


def tls_of_client(config: Config) -> Tls | None:
    """Return what the configured API presents; None without certificates.

    Raises
    ------
    ConfigurationError
        If there is no certificate.
    CertificateError
        If it cannot be used.
    """
    tls = config.tls("client")
    if tls is not None:
        tls.name()
    return tls
