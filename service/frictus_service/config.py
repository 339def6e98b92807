"""Configuration: one TOML file, validated once, immutable afterwards.

Nothing needs to be configured: the defaults are a simulated rig on this machine. An error names
the file and the line at fault, what was wrong there and what is accepted.
"""

import hashlib
import hmac
import ipaddress
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from frictus.keys import RigKeys
from frictus.lenient import Exact
from frictus.messages import AdaptationPolicy
from frictus.names import NAME, Matching, Name
from frictus.session import DEFAULT_ROUTER, LEASE_MS
from frictus.tls import SCHEME, Tls
from frictus_hardware import (
    BackendConfig,
    SimulatedConfig,
)
from frictus_service.errors import ConfigurationError

Scope = Literal["read", "render", "calibrate", "admin"]
LOCAL: Final = "local"
"""Who asks the API where nobody needs a token."""
Origin = Annotated[
    str,
    Field(max_length=300),
    Matching(
        r"^https?://([a-z0-9.-]+|\[[0-9a-f:]+\])(:[0-9]{1,5})?$",
        "http://HOST:PORT and https://HOST:PORT are accepted, in lower case and without a path",
    ),
]
"""As browsers send it: lower case, without a path, and without the port that is usual."""
_SECRET = Matching(r"^[!-~]{16,}$", "16 or more visible ASCII characters are accepted")
DEFAULT_FILE = Path("frictus.toml")
_SQLITE = "sqlite:///"
Place = tuple[str | int, ...]
"""Of a key in the file: tables, and numbers in arrays of tables."""
_DATABASE = (
    r"^(sqlite:///[^?:]|postgresql\+psycopg://).*$",
    "sqlite:///FILE and postgresql+psycopg://USER@HOST/NAME are accepted",
)


def _fault_at(place: Place, what: str) -> PydanticCustomError:
    """Return the error of a section as a whole, for `config_file` to name the line at fault.

    Parameters
    ----------
    place : tuple of str and int
        The key below the section that it is best mended at.
    what : str
        The section at fault.
    """
    return PydanticCustomError("misfit", "{what}", {"what": what, "place": place})


def _with_port(endpoint: str) -> str:
    port = endpoint.rpartition(":")[2]
    if not 1 <= int(port[:6]) <= 65_535:
        raise ValueError(f"port {port[:20]}: 1 to 65535 are accepted")
    return endpoint


class RouterConfig(Exact):
    """Where the parts of the system meet."""

    endpoint: Annotated[
        str,
        Matching(
            r"^(tcp|tls)/.+:\d+$",
            "tcp/ADDRESS:PORT and tls/HOST:PORT are accepted, such as tcp/127.0.0.1:7447",
        ),
        AfterValidator(_with_port),
    ] = DEFAULT_ROUTER
    """Zenoh endpoint: `tcp/ADDRESS:PORT`, or `tls/HOST:PORT` with a [security] section."""
    host: bool = True
    """Whether `frictus serve` listens there itself; false connects to a router elsewhere."""
    links: tuple[
        Annotated[
            str,
            Matching(
                r"^tcp/.+:\d+$", "tcp/ADDRESS:PORT is accepted, such as tcp/192.168.1.10:7447"
            ),
            AfterValidator(_with_port),
        ],
        ...,
    ] = ()
    """Other routers, `tcp/ADDRESS:PORT`, that the one which runs here is linked to: one of two
    names the other. For a network without certificates, as yet."""


class SecurityConfig(Exact):
    """Certificates, as `frictus pki` makes them; each key stands beside its certificate."""

    authority: Path
    """Certificate of the authority that signed all others."""
    router: Path | None = None
    """What the router that runs here presents."""
    members: Path | None = None
    """Folder with the certificates, not the keys, of all who may use that router."""
    rig: Path | None = None
    """What the rig of this machine and its recorder present: role `rig`."""
    client: Path | None = None
    """What API and commands present: role `controller`, or `observer` to look on."""

    def of(self, who: Literal["router", "rig", "client"]) -> Tls:
        """Return the certificates that `who` presents.

        Raises
        ------
        ConfigurationError
            If none is configured.
        """
        certificate: Path | None = getattr(self, who)
        if certificate is None:
            raise ConfigurationError(
                f"security.{who}: this key is required to run or connect a {who} with "
                "certificates; `frictus pki issue` makes one"
            )
        return Tls(self.authority, certificate)

    def within(self, folder: Path) -> Self:
        """Return this section with relative files made relative to `folder`."""
        files = {name: path for name, path in self if path is not None}
        return self.model_copy(update={name: folder / path for name, path in files.items()})


class Limits(Exact):
    """What the rig accepts, and how long it waits before it makes the output safe."""

    max_lease_ms: Annotated[int, Field(ge=100, le=10_000)] = 10_000
    """Longest lease granted; longer requests are refused."""
    max_command_age_ms: Annotated[int, Field(ge=10, le=60_000)] = 5_000
    """A command is stale after its own time to live, or after this, whichever ends first."""
    max_clock_ahead_ms: Annotated[int, Field(ge=1, le=60_000)] = 500
    """How far a sender's clock may be ahead of this machine's."""
    max_payload_bytes: Annotated[int, Field(ge=1_024, le=64_000_000)] = 256_000
    """Larger commands are refused unread."""
    max_scene_bytes: Annotated[int, Field(ge=1_024, le=64_000_000)] = 2_700_000
    """The same for scenes, whose maps carry images."""
    finger_stale_ms: Annotated[int, Field(ge=20, le=1_000)] = 100
    """Without a touch report for so long, rendering is suspended."""
    monitor_tolerance_v: Annotated[float, Field(gt=0.0, le=75.0)] = 5.0
    """How far the monitored screen voltage may be off the drive, V rms over a block."""
    force_limit_n: Annotated[float, Field(gt=0.0, le=1_000.0)] = 10.0
    """A force on the screen, of any direction, beyond which the rig trips."""
    freeze_ms: Annotated[int, Field(ge=50, le=10_000)] = 250
    """A block loop that stands still for so long is killed, and the device is reset."""
    missed_deadlines: Annotated[int, Field(ge=1, le=1_000)] = 40
    """So many blocks in a row, each more than a block late, trip the rig."""


class Token(Exact):
    """A bearer token of the REST API; give its SHA-256 rather than the token itself."""

    name: Annotated[str, Field(min_length=1, max_length=40), NAME]
    """By which rigs name whoever has it; what is added to it for pages fits behind."""
    scopes: Annotated[tuple[Scope, ...], Field(min_length=1)]
    sha256: (
        Annotated[
            str,
            Matching(
                r"^[0-9a-f]{64}$",
                "64 digits of 0 to 9 and a to f are accepted: printf '%s' TOKEN | sha256sum",
            ),
        ]
        | None
    ) = None
    """Hexadecimal SHA-256 of the token, lower case."""
    value: Annotated[str, _SECRET] | None = Field(default=None, repr=False)
    """The token in the clear, at least 16 visible ASCII characters: HTTP carries no others."""

    @model_validator(mode="after")
    def _one_secret(self) -> Self:
        if (self.sha256 is None) == (self.value is None):
            raise ValueError("give either sha256 or value, not both and not neither")
        return self

    @property
    def digest(self) -> str:
        """Hexadecimal SHA-256 of the token."""
        return self.sha256 or hashlib.sha256((self.value or "").encode()).hexdigest()

    def matches(self, presented: str) -> bool:
        """Return whether this is the token presented, in constant time."""
        digest = hashlib.sha256(presented.encode()).hexdigest()
        return hmac.compare_digest(digest, self.digest)


class ApiConfig(Exact):
    """The REST API."""

    enabled: bool = True
    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65_535)] = 8420
    max_connections: Annotated[int, Field(ge=10, le=100_000)] = 1_000
    """Beyond, requests are answered with 503; the descriptors of the process bound it, too."""
    max_requests_per_s: Annotated[float, Field(ge=1.0, le=100_000.0)] = 500.0
    """Of one address, in the long run; twice as many may come at once."""
    page_lease_ms: Annotated[int, Field(ge=100, le=10_000)] = 500
    """How long a rig that a page holds goes on without hearing from the API. With more than
    `frictus.session.LEASE_MS`, for simulated rigs alone, its link lasts longer, too."""
    origins: Annotated[tuple[Origin, ...], Field(max_length=32)] = ()
    """Of pages elsewhere that may open the WebSocket, such as ``https://lab.example.org``."""
    tokens: tuple[Token, ...] = ()
    """Without any, the API is open to this machine and must stay on loopback."""

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach the API."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @model_validator(mode="after")
    def _guarded(self) -> Self:
        if not self.loopback and not self.tokens:
            raise _fault_at(
                ("host",),
                f"host {self.host!r} can be reached by other machines: add [[api.tokens]], "
                "or bind 127.0.0.1",
            )
        names = [token.name for token in self.tokens]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise _fault_at(("tokens", index, "name"), f"another token is called {name!r}")
        secrets = [token.digest for token in self.tokens]
        for index, secret in enumerate(secrets):
            if secret in secrets[:index]:
                other = names[secrets.index(secret)]
                what = f"the token {other!r} has the same secret: give each its own"
                raise _fault_at(("tokens", index), what)
        return self


class RegistryConfig(Exact):
    """Where models and calibrations are kept."""

    url: Annotated[str, Field(repr=False), Matching(*_DATABASE)] = f"{_SQLITE}frictus.db"
    """SQLAlchemy URL: `sqlite:///FILE`, relative to this file, or `postgresql+psycopg://…`."""

    def within(self, folder: Path) -> Self:
        """Return this section with a relative file made relative to `folder`."""
        scheme, file = self.url[: len(_SQLITE)], self.url[len(_SQLITE) :]
        if scheme != _SQLITE:
            return self
        return self.model_copy(update={"url": f"{_SQLITE}{(folder / file).as_posix()}"})


class TrackerConfig(Exact):
    """The process that learns the finger while anything plays."""

    enabled: bool = True
    policy: AdaptationPolicy = "observe"
    """Of a rig that starts; whoever may calibrate changes it while it runs."""
    mount: Literal["paper", "none"] | Path = "paper"
    """Between the screen and the force sensor; a file is as `frictus mount` writes it."""
    audit: Path = Path("adaptations.jsonl")
    """File that each change of the model is added to, before and after."""

    def within(self, folder: Path) -> Self:
        """Return this section with relative files made relative to `folder`."""
        mount = folder / self.mount if isinstance(self.mount, Path) else self.mount
        return self.model_copy(update={"mount": mount, "audit": folder / self.audit})


class Config(Exact):
    """Everything the service can be told."""

    site: Name = "lab"
    rig: Name = "rig1"
    block_ms: Annotated[float, Field(ge=1.0, le=50.0)] = 5.0
    """Length of a block; a whole number of samples of the backend."""
    model_file: Path | None = None
    """A `model/1` document; without one, a placeholder that every message shows."""
    textures: Path = Path("textures")
    """Folder of the texture library."""
    recordings: Path = Path("recordings")
    """Folder that the recorder writes to."""
    studies: Path = Path("studies")
    """Folder of the study files that calibrations make."""
    backend: BackendConfig = SimulatedConfig()
    router: RouterConfig = RouterConfig()
    limits: Limits = Limits()
    api: ApiConfig = ApiConfig()
    registry: RegistryConfig = RegistryConfig()
    tracker: TrackerConfig = TrackerConfig()
    security: SecurityConfig | None = None
    """Without it, whoever reaches the router may do everything."""

    def tls(self, who: Literal["router", "rig", "client"]) -> Tls | None:
        """Return the certificates that `who` presents; None in a network without.

        Raises
        ------
        ConfigurationError
            If certificates are used, and `who` has none.
        """
        return None if self.security is None else self.security.of(who)

    @property
    def rig_files(self) -> dict[Place, Path]:
        """The files that the rig is made from, by the keys that name them."""
        files: dict[Place, Path] = {}
        if self.model_file is not None:
            files["model_file",] = self.model_file
        files |= {("backend", *keys): file for keys, file in self.backend.files.items()}
        return files

    @property
    def keys(self) -> RigKeys:
        """The keys of this rig."""
        return RigKeys(self.site, self.rig)

    @property
    def sample_rate_hz(self) -> float:
        """Nominal rate of the backend's clock."""
        return self.backend.nominal_rate_hz

    @property
    def block_samples(self) -> int:
        """Length of a block, in samples."""
        return round(1e-3 * self.block_ms * self.sample_rate_hz)

    @property
    def clock_scale(self) -> float:
        """Seconds of the backend's clock per second of this machine's."""
        return self.backend.clock_scale

    @model_validator(mode="after")
    def _encrypted_with_certificates(self) -> Self:
        endpoint = self.router.endpoint
        if (self.security is not None) != endpoint.startswith(SCHEME):
            raise _fault_at(
                ("router", "endpoint") if "router" in self.model_fields_set else ("security",),
                f"router.endpoint {endpoint!r}: tls/HOST:PORT goes with a [security] section, "
                "and tcp/HOST:PORT without",
            )
        return self

    @model_validator(mode="after")
    def _patient_with_no_finger(self) -> Self:
        simulated = self.backend.kind == "simulated"
        if self.api.page_lease_ms > LEASE_MS and not simulated:
            raise _fault_at(
                ("api", "page_lease_ms"),
                f"page_lease_ms {self.api.page_lease_ms}: of a rig that a finger touches "
                f"at most {LEASE_MS} is accepted, more of a simulated one alone",
            )
        return self

    @model_validator(mode="after")
    def _links_without_certificates(self) -> Self:
        if self.router.links and self.security is not None:
            raise _fault_at(
                ("router", "links"),
                "routers are linked without certificates only: leave links out, and have all "
                "machines meet at one router, or leave [security] out on a trusted network",
            )
        return self

    @model_validator(mode="after")
    def _whole_blocks(self) -> Self:
        samples = 1e-3 * self.block_ms * self.sample_rate_hz
        if abs(samples - round(samples)) > 1e-6:
            own = "block_ms" in self.model_fields_set
            raise _fault_at(
                ("block_ms",) if own else ("backend", "sample_rate_hz"),
                f"block_ms {self.block_ms:g} is {samples:g} samples at "
                f"{self.sample_rate_hz:g} Hz: a whole number is accepted",
            )
        return self

    @model_validator(mode="after")
    def _blocks_shorter_than_a_freeze(self) -> Self:
        took_ms, freeze_ms = self.block_ms / self.clock_scale, self.limits.freeze_ms
        if took_ms > 0.5 * freeze_ms:
            scaled = self.clock_scale != 1.0
            raise _fault_at(
                ("backend",) if scaled else ("block_ms",),
                f"a block of {self.block_ms:g} ms takes {took_ms:g} ms at a clock of "
                f"{self.clock_scale:g}, which limits.freeze_ms = {freeze_ms} would take for a "
                f"loop that stands still: at most {0.5 * freeze_ms:g} ms are accepted",
            )
        return self
