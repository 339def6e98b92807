"""The router of a site, with certificates and roles where they are configured."""

import zenoh

from frictus.session import open_router
from frictus_service.config import Config
from frictus_service.errors import ConfigurationError
from frictus_service.security.access import access_control


def open_secured_router(config: Config) -> zenoh.Session:
    """Host the configured router in this process.

    Parameters
    ----------
    config : Config
        Its router and security sections are used; without the latter, whoever reaches the
        router may do everything.

    Raises
    ------
    ConfigurationError
        If certificates are used and the router has none, or no folder of members.
    CertificateError, CertificateFileError
        If a certificate cannot be used.
    LinkError
        If nothing can listen there.
    """
    endpoint, security = config.router.endpoint, config.security
    if security is None:
        return open_router(endpoint, links=config.router.links)
    if security.members is None:
        raise ConfigurationError(
            "security.members: this key is required where the router runs: the folder with "
            "the certificates of all who may use it"
        )
    from frictus_service.security.files import members_in  # only with certificates

    access = access_control(members_in(security.members))
    return open_router(endpoint, security.of("router"), access)
