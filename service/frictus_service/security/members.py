"""The members of a site's network, and what the parts of a service present."""

from dataclasses import dataclass
from typing import Final, Literal, Self, get_args

from frictus.keys import InvalidNameError, RigKeys
from frictus.names import MAX_NAME
from frictus.tls import Tls
from frictus_service.config import Config
from frictus_service.errors import ConfigurationError, MemberNameError

Role = Literal["router", "rig", "controller", "observer"]
ROLES: Final[tuple[Role, ...]] = get_args(Role)
LONGEST: Final = 64
"""X.509 allows a common name no more characters."""


@dataclass(frozen=True, slots=True)
class Member:
    """Somebody with a certificate.

    Attributes
    ----------
    role : {'router', 'rig', 'controller', 'observer'}
    name : str
        Letters, digits, ``-``, ``_`` and ``.``; of a rig ``SITE/RIG``, as in its keys.

    Raises
    ------
    MemberNameError
        If there is no such role, or the name cannot stand in a certificate.
    """

    role: Role
    name: str

    def __post_init__(self) -> None:
        """Refuse what cannot stand in a certificate."""
        if self.role not in ROLES:
            raise MemberNameError(f"no role {self.role!r}: {', '.join(ROLES)} accepted")
        try:
            _ = self.rig_keys if self.role == "rig" else RigKeys("site", self.name)
        except InvalidNameError as error:
            shape = (
                "SITE/RIG, as `site` and `rig` in its configuration, such as lab/rig1, each"
                if self.role == "rig"
                else "one name"
            )
            raise MemberNameError(
                f"{self.role} {self.name!r}: accepted: {shape} of 1 to {MAX_NAME} letters, "
                "digits, '-', '_' and '.'"
            ) from error
        if len(self.common_name) > LONGEST:
            raise MemberNameError(
                f"{self.common_name!r} has {len(self.common_name)} characters: a certificate "
                f"takes {LONGEST}; choose a shorter name"
            )

    @property
    def common_name(self) -> str:
        """What stands in the certificate, and what the router looks at."""
        return f"{self.role}:{self.name}"

    @property
    def stem(self) -> str:
        """Name of its files, without suffix."""
        return f"{self.role}-{self.name.replace('/', '-')}"

    @property
    def rig_keys(self) -> RigKeys:
        """The keys of the rig that bears this name."""
        site, _, rig = self.name.partition("/")
        return RigKeys(site, rig)

    @classmethod
    def of(cls, common_name: str) -> Self:
        """Return the member whose certificate bears a common name.

        Raises
        ------
        MemberNameError
            If the certificate is none of ours.
        """
        role, _, name = common_name.partition(":")
        return cls(role, name)  # type: ignore[arg-type]  # checked on the way in


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
