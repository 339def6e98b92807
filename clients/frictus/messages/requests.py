"""What clients ask of a rig, and its answer."""

from typing import Annotated

from pydantic import AfterValidator, Field, FiniteFloat

from frictus.keys import of_a_file
from frictus.lenient import LISTED
from frictus.messages.base import (
    MAX_REASON,
    AdaptationPolicy,
    Count,
    Message,
    RefusalCode,
    SafetyState,
    UtcNs,
)
from frictus.messages.states import Applied, Excitation
from frictus.model import Compensation, Model
from frictus.names import MAX_NAME, NAME, Name, Pseudonym
from frictus.textures import PositionMm, RmsFriction, Scene


class Request(Message):
    """What every call carries."""

    client: Name
    utc_ns: UtcNs
    ttl_ms: Annotated[int, Field(gt=0, le=60_000)] = 1_000


class ArmRequest(Request):
    """Take the rig and let it drive the screen while the lease is renewed."""

    lease_ms: Annotated[int, Field(ge=100, le=10_000)] = 500
    share_with: Annotated[tuple[Name, ...], Field(max_length=16), LISTED] = ()
    """Others who may set scenes, stream and excite until the lease ends: clients, or people by
    what stands before the last dot of their clients' names."""
    keep_model: bool = False
    """Whether no tracker may change the model until the lease ends: for trials."""


class SceneRequest(Request):
    """Replace the scene, with a cross-fade."""

    scene: Scene
    if_match: str | None = None


class OpenStreamRequest(Request):
    """Announce a streamed texture: its peak friction fixes bias and gain until it ends."""

    peak_n: RmsFriction


class CloseStreamRequest(Request):
    """End the streamed texture; harmless where it has ended, and another is played."""

    ticket: Count | None = None
    """Of the stream; null: whichever is open."""


class ModelRequest(Request):
    """Replace the active friction model; only while disarmed."""

    model: Model
    if_match: str | None = None


class AdaptationRequest(Request):
    """Choose what a tracker may do with the model."""

    policy: AdaptationPolicy
    undo: bool = False
    """Whether to put the model back in force that was set before it was adapted."""


class AdaptRequest(Request):
    """Have gain and cutoff follow the finger while it plays, with a cross-fade.

    From a tracker, under the policy `adapt` alone. All else of the model stays as it is.
    """

    model: Model
    if_match: Annotated[str, Field(max_length=MAX_NAME)]
    """Etag of the model in force that it was adapted from."""
    reason: Annotated[str, Field(max_length=MAX_REASON)] = ""


class ExciteRequest(Request):
    """Play an excitation instead of the scene until the lease or `scene` ends it."""

    excitation: Excitation


class CompensationRequest(Request):
    """Choose the compensation mode until the lease ends; only while armed."""

    compensation: Compensation


class RecordRequest(Request):
    """Start a recording."""

    name: Annotated[
        str,
        Field(min_length=1, max_length=100),
        NAME,
        AfterValidator(of_a_file),
    ]
    """Of the file, too: it ends without a dot and is no device of Windows, such as ``nul``."""
    participant: Pseudonym | None = None
    notes: Annotated[str, Field(max_length=10_000)] = ""


class LeaseRenewal(Request):
    """Sent by the owner several times per lease; without it the output ramps to zero."""


class PointerState(Request):
    """Drives the virtual finger of a simulated rig whose finger is set to `client`."""

    x_mm: PositionMm
    y_mm: PositionMm
    in_contact: bool
    normal_force_n: Annotated[FiniteFloat, Field(ge=0.0, le=5.0)] = 0.4


class Reply(Message):
    """The answer to every call."""

    ok: bool
    code: RefusalCode | None = None
    message: str = ""
    state: SafetyState = "disarmed"
    etag: str | None = None
    applied: Applied | None = None
    ticket: Count | None = None
    """Of an opened stream; goes into every `StreamFrame`."""
    compensation: Compensation | None = None
    """The mode in force, where it was asked for."""
    adaptation: AdaptationPolicy | None = None
    """The policy in force, where it was asked for."""
    utc_ns: UtcNs | None = None
    """When the answer was given, by the rig's clock: states from then on include it."""
