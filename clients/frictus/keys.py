"""The one table of keys: what is said where, in which type and unit, with which quality.

Nothing else in the project spells a key. Keys are
``frictus/@v1/{site}/{rig}/{suffix}``; the verbatim chunks (``@``) keep versions and calls out
of ``**``.
"""

import re
from dataclasses import dataclass
from typing import Final

from frictus.errors import FrictusError
from frictus.names import MAX_NAME

RESERVED: Final = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""Devices on Windows, whatever extension follows."""


def of_a_file(name: str) -> str:
    """Return a name if a file on Linux and on Windows can bear it.

    Parameters
    ----------
    name : str
        Without folders.

    Raises
    ------
    ValueError
        If it ends with a dot, as ``.`` and ``..`` do, or is a device on Windows.
    """
    if name.endswith("."):
        raise ValueError(
            f"{name!r} ends with a dot, which no file on Windows may: leave it out"
        )
    if RESERVED.fullmatch(name):
        raise ValueError(f"{name!r} is the name of a device on Windows: choose another")
    return name


ROOT: Final = "frictus/@v1"


class InvalidNameError(FrictusError, ValueError):
    """A site, rig or client name that cannot stand in a key."""


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of one key, with the reason for it.

    Attributes
    ----------
    priority : str
        Name of a member of `zenoh.Priority`.
    block : bool
        Whether a full queue makes the sender wait (True) or drops the message.
    express : bool
        Sent at once, rather than batched with others.
    why : str
        The reason.
    """

    priority: str
    block: bool
    express: bool
    why: str


# Reasons are measured; docs/protocol.md gives the figures.
NEWEST = Qos("INTERACTIVE_HIGH", False, False, "newest wins; a slow viewer must not stall it")
STREAM = Qos("DATA_HIGH", False, False, "lost blocks show as sequence gaps; never stall")
LATEST = Qos("DATA", False, False, "few and small; late joiners get the cached last one")
COMMAND = Qos("REAL_TIME", True, True, "few, urgent, sent by a client that may wait")


@dataclass(frozen=True, slots=True)
class Topic:
    """One key below a rig.

    Attributes
    ----------
    suffix : str
        What follows the rig's prefix.
    message : str
        Type of the message; for blocks with the names of the channels.
    unit : str
        Units of the quantities in it.
    qos : Qos
        The service it is sent with.
    latest : bool
        Whether the last value is cached for late joiners.
    """

    suffix: str
    message: str
    unit: str
    qos: Qos
    latest: bool = False


class Topics:
    """Every published key of a rig."""

    FINGER = Topic("state/finger", "FingerState", "mm, mm/s, N", NEWEST)
    TOUCH = Topic("state/touch", "TouchState", "mm", STREAM)
    GUIDANCE = Topic("state/guidance", "GuidanceState", "mm, mm/s, N", NEWEST)
    RECORDING = Topic("state/recording", "RecordingState", "-", LATEST, latest=True)
    STATUS = Topic("state/status", "RigStatus", "-", LATEST, latest=True)
    SCENE = Topic("state/scene", "SceneState", "mm, N", LATEST, latest=True)
    MODEL = Topic("state/model", "ModelState", "-", LATEST, latest=True)
    TIME = Topic("state/time", "TimeState", "ns", LATEST, latest=True)
    ESTIMATE = Topic("state/estimate", "EstimateState", "N, Hz, us, dB", LATEST, latest=True)
    MARKER = Topic("state/marker", "MarkerState", "-", LATEST)
    FORCE = Topic("stream/force", "Block: x, y, z", "N", STREAM)
    ACCEL = Topic("stream/accel", "Block: x, y, z", "m/s^2", STREAM)
    VOLTAGE = Topic("stream/voltage", "Block: monitor", "V", STREAM)
    TRUTH = Topic(
        "stream/truth",
        "Block: x mm, y mm, vx mm/s, vy mm/s, friction N",
        "as named",
        STREAM,
    )
    AUX = Topic("stream/aux", "Block: as `aux` of the status names them", "as named", STREAM)
    RENDER = Topic(
        "stream/render",
        "Block: x mm, y mm, speed mm/s, target N, drive, sensors",
        "as named",
        STREAM,
    )
    TEXTURE = Topic("cmd/texture", "StreamFrame", "N", COMMAND)
    LEASE = Topic("cmd/lease", "LeaseRenewal", "-", COMMAND)
    POINTER = Topic("cmd/pointer", "PointerState", "mm", COMMAND)


TOPICS: Final = tuple(topic for topic in vars(Topics).values() if isinstance(topic, Topic))
FORCE, ACCEL, VOLTAGE, TRUTH, AUX, RENDER = range(1, 7)
"""Stream ids, as they stand in a block's header."""

STREAMS: Final = {
    FORCE: Topics.FORCE,
    ACCEL: Topics.ACCEL,
    VOLTAGE: Topics.VOLTAGE,
    TRUTH: Topics.TRUTH,
    AUX: Topics.AUX,
    RENDER: Topics.RENDER,
}
"""Stream id in a block's header, to its topic; a rig publishes those that it has."""

CHANNELS: Final[dict[int, tuple[str, ...]]] = {
    FORCE: ("x_n", "y_n", "z_n"),
    ACCEL: ("x_m_s2", "y_m_s2", "z_m_s2"),
    VOLTAGE: ("monitor_v",),
    TRUTH: ("x_mm", "y_mm", "vx_mm_s", "vy_mm_s", "friction_n"),
    RENDER: ("x_mm", "y_mm", "speed_mm_s", "target_n", "drive", "sensors"),
}
"""Names of a stream's channels, with their units; those of `aux` are in the status."""

CALLS: Final = {
    "arm": "ArmRequest",
    "disarm": "Request",
    "stop": "Request",
    "reset": "Request",
    "scene": "SceneRequest",
    "open_stream": "OpenStreamRequest",
    "close_stream": "CloseStreamRequest",
    "model": "ModelRequest",
    "adaptation": "AdaptationRequest",
    "adapt": "AdaptRequest",
    "excite": "ExciteRequest",
    "compensation": "CompensationRequest",
}
"""Name of each call of a rig below ``@rpc/`` to its request type; every reply is a `Reply`."""
RECORDER_CALLS: Final = {
    "record": "RecordRequest",
    "end_recording": "Request",
}
"""The calls that a rig's recorder answers, likewise."""


def person_of(client: str) -> str:
    """Return whom a client acts for: what stands before the last dot of its name, if one does.

    A service that speaks for several people gives each of them clients of its own: ``ann.rest``
    and ``ann.page-7c2e41`` are ann's.

    Parameters
    ----------
    client : str
        Name of a client.
    """
    return client.rpartition(".")[0] or client


_NOUNS: Final = {
    "page": "page",
    "participant": "participant's page",
    "rest": "REST client",
    "calibration": "calibration",
    "experiment": "experiment",
}
_OF_SERVICE: Final = re.compile(rf"(.+)\.({'|'.join(_NOUNS)})(?:-[0-9a-f]+)?")
_OF_PROGRAM: Final = re.compile(r"(.+)-(\d+)-[0-9a-f]{6}")
_ANYBODY: Final = "local"
"""Whom a service that asks for no tokens speaks for."""


def spoken_name(client: str | None) -> str:
    """Return a client as people know it: ``ann's page``, ``a calibration``, ``'linen-study'``.

    A service makes the names of its pages and jobs, and `frictus.connect` that of a program
    which gives none; every other name is its client's own, and stays in quotation marks.

    Parameters
    ----------
    client : str or None
        Name of a client; None: there is none.
    """
    if client is None:
        return "nobody"
    if made := _OF_SERVICE.fullmatch(client):
        person, noun = made[1], _NOUNS[made[2]]
        if made[2] == "participant":  # whoever's token its tablet has
            return f"the {noun}"
        article = "an" if noun[0] in "aeiou" else "a"
        return f"{article} {noun}" if person == _ANYBODY else f"{person}'s {noun}"
    if made := _OF_PROGRAM.fullmatch(client):
        return f"a program on {made[1]} (process {made[2]})"
    return repr(client)


def _checked(name: str, what: str) -> str:
    if not isinstance(name, str) or not name or len(name) > MAX_NAME or not name.isascii():
        raise InvalidNameError(
            f"{what} name {name!r}: 1 to {MAX_NAME} ASCII characters are accepted"
        )
    if not all(letter.isalnum() or letter in "-_." for letter in name):
        raise InvalidNameError(f"{what} name {name!r}: letters, digits, '-', '_' and '.' only")
    return name


@dataclass(frozen=True, slots=True)
class RigKeys:
    """The keys of one rig.

    Attributes
    ----------
    site, rig : str
        Names of 1 to 64 letters, digits, ``-``, ``_`` and ``.``.

    Raises
    ------
    InvalidNameError
        If a name cannot stand in a key.
    """

    site: str
    rig: str

    def __post_init__(self) -> None:
        """Refuse names that cannot stand in a key."""
        _checked(self.site, "site")
        _checked(self.rig, "rig")

    @property
    def base(self) -> str:
        """The rig's own prefix."""
        return f"{ROOT}/{self.site}/{self.rig}"

    def of(self, topic: Topic) -> str:
        """Return the key of a topic.

        Parameters
        ----------
        topic : Topic
            A member of `Topics`.
        """
        return f"{self.base}/{topic.suffix}"

    def call(self, name: str) -> str:
        """Return the key of a call.

        Parameters
        ----------
        name : str
            A key of `CALLS` or of `RECORDER_CALLS`.

        Raises
        ------
        KeyError
            If there is no such call.
        """
        calls = CALLS | RECORDER_CALLS
        if name not in calls:
            raise KeyError(f"no call {name!r}; the calls are {', '.join(calls)}")
        return f"{self.base}/@rpc/{name}"

    @property
    def alive(self) -> str:
        """The rig's liveliness token."""
        return f"{self.base}/@alive/rig"

    def client_alive(self, client: str) -> str:
        """Return the liveliness token that a client holds while it uses this rig.

        Parameters
        ----------
        client : str
            Name of the client.

        Raises
        ------
        InvalidNameError
            If the name cannot stand in a key.
        """
        return f"{self.base}/@alive/client/{_checked(client, 'client')}"

    @property
    def any_client_alive(self) -> str:
        """Key expression of the tokens of all clients of this rig."""
        return f"{self.base}/@alive/client/*"


def any_rig_alive(site: str = "*") -> str:
    """Return the key expression that finds the rigs of a site, or of all.

    Parameters
    ----------
    site : str
        One site, or ``*`` for all.

    Raises
    ------
    InvalidNameError
        If the name cannot stand in a key.
    """
    return f"{ROOT}/{site if site == '*' else _checked(site, 'site')}/*/@alive/rig"


def rig_of(key: str) -> RigKeys:
    """Return the rig that a key belongs to.

    Parameters
    ----------
    key : str
        Any key below `ROOT`.

    Raises
    ------
    ValueError
        If the key is not below `ROOT`.
    """
    parts = key.split("/")
    if len(parts) < 5 or "/".join(parts[:2]) != ROOT:
        raise ValueError(f"{key!r} is not a key of frictus: {ROOT}/site/rig/…")
    return RigKeys(parts[2], parts[3])
