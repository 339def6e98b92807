"""The JSON messages of the live connection `/v1/live`; `docs/websocket.md`.

The service reads with the same models with which the client writes.
"""

from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, SecretStr

from frictus.keys import Topic, Topics
from frictus.lenient import NO_TRUTH
from frictus.messages import Applied, Count, Message, UtcNs
from frictus.names import Name
from frictus.textures import PositionMm, RmsFriction, Scene
from frictus.watched_rig import StreamName

VERSION: Final = 1
PROTOCOL: Final = "1.2"
"""Version and what was added to it: a newer 1.x only adds fields and messages."""
MAX_BYTES: Final = 65_536
MAX_TOKEN: Final = 1_000
MAX_RATE_HZ: Final = 60.0
MAX_PER_COLUMN: Final = 1 << 23
"""Held until a column is complete; 10 minutes in 16 columns take 7,500,000 at 200 kHz."""
RequestId = Annotated[int, Field(ge=0, lt=2**53)]
"""Chosen by the page; the answer, or the refusal, has it."""


class _Asked(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Hello(_Asked):
    """The first message: who asks. It is the only one with a token."""

    op: Literal["hello"]
    version: Annotated[Literal[1], NO_TRUTH]
    token: Annotated[SecretStr, Field(max_length=MAX_TOKEN)] | None = None
    page: Literal["participant"] | None = None
    """In front of whom it is, as others read of whoever stops or holds a rig."""


class Watch(_Asked):
    """What to send; takes the place of what was watched."""

    op: Literal["watch"]
    rig: Name | None
    """Name of the rig; None: nothing."""
    streams: Annotated[tuple[StreamName, ...], Field(max_length=6)] = ()
    rate_hz: Annotated[FiniteFloat, Field(ge=1.0, le=MAX_RATE_HZ)] = MAX_RATE_HZ
    """Most frames of a stream per second."""
    columns: Annotated[int, Field(ge=16, le=8_192)] = 1_200
    window_s: Annotated[FiniteFloat, Field(ge=0.01, le=600.0)] = 2.0
    """What `columns` columns span."""
    samples_per_column: Annotated[int, Field(ge=1, le=MAX_PER_COLUMN)] | None = None
    """In place of `columns` and `window_s`."""
    raw: bool = False
    """Samples as they are rather than extremes."""
    fingers: bool = False
    """Every state of the finger, in binary frames, besides the newest as JSON."""


class Point(_Asked):
    """Move the virtual finger of the watched rig."""

    op: Literal["point"]
    x_mm: PositionMm
    y_mm: PositionMm
    in_contact: bool = True
    normal_force_n: Annotated[FiniteFloat, Field(ge=0.0, le=5.0)] = 0.4


class PageArmRequest(_Asked):
    """Take a rig and let it drive its screen while the page is there."""

    op: Literal["arm"]
    rig: Name
    share_with: Annotated[tuple[Name, ...], Field(max_length=16)] = ()
    """Clients and people who may change what is rendered meanwhile."""
    lease_ms: Annotated[int, Field(ge=500, le=10_000)] = 3_000
    """A page that sends nothing for so long loses the rig."""
    keep_model: bool = False
    """Whether no tracker may change the model meanwhile: for trials."""
    id: RequestId | None = None


class PageDisarmRequest(_Asked):
    """Give it back."""

    op: Literal["disarm"]
    rig: Name
    id: RequestId | None = None


class SetScene(_Asked):
    """Replace what the screen feels like, with a cross-fade."""

    op: Literal["set_scene"]
    rig: Name
    scene: Scene
    if_match: Annotated[str, Field(max_length=200)] | None = None
    """Etag that the present scene must have."""
    id: RequestId | None = None


class OpenStream(_Asked):
    """Announce a streamed texture; the rig is armed by this page, or shared with it."""

    op: Literal["open_stream"]
    rig: Name
    peak_n: RmsFriction
    """Largest |friction| that will be sent: it fixes bias and gain."""
    id: RequestId | None = None


class CloseStream(_Asked):
    """End the texture stream; the rig fades to the scene."""

    op: Literal["close_stream"]
    id: RequestId | None = None


class Ping(_Asked):
    """Ask for a pong."""

    op: Literal["ping"]
    id: RequestId


Asked = (
    Hello
    | Watch
    | Point
    | PageArmRequest
    | PageDisarmRequest
    | SetScene
    | OpenStream
    | CloseStream
    | Ping
)


class Welcome(Message):
    """The answer to hello."""

    op: Literal["welcome"] = "welcome"
    version: int = VERSION
    protocol: str = PROTOCOL
    """Version and minor version: a client may need a minor that an older service lacks."""
    scopes: tuple[str, ...]
    site: str
    client: str
    """Name under which rigs know this page: the `owner` of what it has armed."""
    key: str
    """A secret: REST requests with it in the header `Frictus-Page` act as this page."""
    utc_us: Count
    """The service's clock, which stamps of texture updates are by."""


class Rigs(Message):
    """The rigs that are present; without a link to the router, none can be seen."""

    op: Literal["rigs"] = "rigs"
    rigs: tuple[str, ...]
    link: bool


class RigLost(Message):
    """The watched rig is not present. It is watched still."""

    op: Literal["lost"] = "lost"
    rig: str


class Armed(Message):
    """The page holds the rig."""

    op: Literal["armed"] = "armed"
    rig: str
    id: int | None = None


class Disarmed(Message):
    """The page holds the rig no more."""

    op: Literal["disarmed"] = "disarmed"
    rig: str
    reason: str
    """Why, where the page did not ask for it; else empty."""
    by: str | None = None
    """The client that stopped the rig, where one did."""
    utc_ns: UtcNs | None = None
    """When it ended, by the rig's clock, where the rig said so."""
    id: int | None = None


class SceneSet(Message):
    """The scene is in force."""

    op: Literal["scene_set"] = "scene_set"
    rig: str
    etag: str
    applied: Applied
    id: int | None = None


class StreamOpened(Message):
    """Updates may be sent: binary frames with this ticket."""

    op: Literal["stream_opened"] = "stream_opened"
    rig: str
    ticket: Count
    applied: Applied
    id: int | None = None


class StreamUpdates(Message):
    """What became of the updates of a texture stream, since it was opened."""

    sent: Count
    """Passed on to the rig."""
    superseded: Count
    """Left out, for a newer one came before they could be passed on."""
    expired: Count
    """Left out, for they were older than their time to live, or stamped in the future."""
    newest: Count | None
    """Sequence number of the last one passed on."""


class StreamProgress(StreamUpdates):
    """Told after updates came in, at most as often as frames of `watch`."""

    op: Literal["stream"] = "stream"
    rig: str
    ticket: Count


class StreamClosed(StreamUpdates):
    """The texture stream has ended."""

    op: Literal["stream_closed"] = "stream_closed"
    rig: str
    ticket: Count
    reason: str
    """Why, where the page did not ask for it; else empty."""
    id: int | None = None


class Refused(Message):
    """Something was not done."""

    op: Literal["refused"] = "refused"
    what: str
    code: str
    message: str
    id: int | None = None
    """Of the request, where it had one."""


class Pong(Message):
    """The answer to a ping."""

    op: Literal["pong"] = "pong"
    id: int
    utc_us: Count
    """The service's clock."""


Told = (
    Welcome
    | Rigs
    | RigLost
    | Armed
    | Disarmed
    | SceneSet
    | StreamOpened
    | StreamProgress
    | StreamClosed
    | Refused
    | Pong
)
"""What the service sends as JSON, besides what it passes on of rigs."""
VALUES: Final[dict[str, Topic]] = {
    "status": Topics.STATUS,
    "scene": Topics.SCENE,
    "model": Topics.MODEL,
    "finger": Topics.FINGER,
    "guidance": Topics.GUIDANCE,
    "recording": Topics.RECORDING,
    "estimate": Topics.ESTIMATE,
}
"""Name of each JSON message that is passed on; of each, the newest wins."""
