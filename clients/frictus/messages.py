"""JSON messages on the wire. Every quantity carries its unit in its name.

Readers are lenient to what newer writers add; NaN and infinities are refused.
"""

from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from frictus.errors import FrameError, explain
from frictus.keys import MAX_NAME, of_a_file
from frictus.model import BY_MODEL, Compensation, Model
from frictus.textures import PhaseRad, PositionMm, RmsFriction, Scene

RefusalCode = Literal[
    "bad_request",  # the payload cannot be read; the text says where
    "too_large",  # larger than the rig reads
    "stale",  # older than its time to live, or from the future: check the clocks
    "not_owner",  # another client holds the rig
    "not_armed",
    "tripped",  # latched until an operator resets it
    "conflict",  # what was to be replaced is not what the caller saw
    "not_feasible",  # cannot be rendered; the text says why
    "unavailable",  # the rig is not ready
]
SafetyState = Literal["disarmed", "armed", "stopping", "tripped"]
AdaptationPolicy = Literal["observe", "suggest", "adapt"]
"""What a rig's tracker may do with what it learns: tell it; say which model it would put in
force; have the rig follow the finger's gain and cutoff while it plays."""
FaultKind = Literal[
    "config",
    "transient",
    "stream_lost",
    "device_lost",
    "link_lost",
    "sensor",
    "safety",
    "deadline",
    "internal",
]


UtcNs = Annotated[int, Field(ge=0, lt=2**63)]
"""UTC since 1970, ns: 64 bits reach to the year 2262."""
MAX_REASON: Final = 500
"""Characters of why something was done."""
MAX_MARKER: Final = 1_000
"""Characters of a marker."""
MAX_COUNT: Final = 2**63 - 1
Count = Annotated[int, Field(ge=0, lt=MAX_COUNT + 1)]
Int64 = Annotated[int, Field(ge=-(2**63), lt=2**63)]
SpanMm = tuple[PositionMm, PositionMm]
ClientName = Annotated[
    str, Field(min_length=1, max_length=MAX_NAME, pattern=r"^[A-Za-z0-9._-]+$")
]


class Message(BaseModel):
    """What all messages share."""

    model_config = ConfigDict(extra="ignore", frozen=True, ser_json_inf_nan="null")

    def to_json(self) -> bytes:
        """Return the message as JSON bytes."""
        return self.model_dump_json(by_alias=True).encode()

    @classmethod
    def from_json(cls, payload: bytes) -> Self:
        """Read a message.

        Parameters
        ----------
        payload : bytes
            JSON text in UTF-8.

        Raises
        ------
        FrameError
            If it is not JSON, or a field is missing, of another type or out of range.
        """
        try:
            return cls.model_validate_json(payload)
        except ValidationError as error:
            raise FrameError(f"not a {cls.__name__}: {explain(error)}") from error


SensorName = Literal["touch", "acceleration", "force"]


class FingerState(Message):
    """Where the finger is and how it moves, as the sensors say it."""

    sequence: Count
    sample: Int64
    """Device sample index this state holds for."""
    utc_ns: UtcNs
    uncertainty_ns: Count
    x_mm: FiniteFloat
    y_mm: FiniteFloat
    vx_mm_s: FiniteFloat
    vy_mm_s: FiniteFloat
    normal_force_n: FiniteFloat
    in_contact: bool
    source: Literal["touch", "pointer", "simulated"]
    age_ms: FiniteFloat
    """Age of the touch report behind this state."""
    stale: bool
    extrapolated: bool
    """Speed outside the model's validity: the compensation used the nearest valid speed."""


class TouchState(Message):
    """One report of the touch sensor as it came, before any prediction."""

    run: Count
    sample: FiniteFloat
    """Device sample index at which the finger was there; a report arrives later than that."""
    x_mm: FiniteFloat
    y_mm: FiniteFloat
    in_contact: bool
    source: Literal["touch", "pointer", "simulated"]


class GuidanceState(Message):
    """What a participant is asked to do, and does; a screen shows it while calibrating.

    The reference moves along x at the target speed, back and forth. Published by whoever
    calibrates, about 30 times a second.
    """

    utc_ns: UtcNs
    participant: str
    phase: Literal["break", "approach", "record", "analyse", "done"]
    trial: Count
    """Number of the trial, from 1."""
    trials: Count | None = None
    seconds_left: Annotated[FiniteFloat, Field(ge=-1e6, le=1e6)]
    """Of this phase."""
    target_speed_mm_s: Annotated[FiniteFloat, Field(ge=0.0, le=10_000.0)]
    target_force_n: Annotated[FiniteFloat, Field(ge=0.0, le=100.0)]
    reference_x_mm: PositionMm
    span_mm: SpanMm
    """Ends of the strokes."""
    x_mm: PositionMm | None = None
    speed_mm_s: Annotated[FiniteFloat, Field(ge=-1e6, le=1e6)] | None = None
    """Actual; None where the finger is not seen."""
    force_n: Annotated[FiniteFloat, Field(ge=-10_000.0, le=10_000.0)] | None = None
    colour: Literal["green", "yellow", "red", "grey"] = "grey"
    """Force in the target range, below, above; grey: no contact."""
    message: str = ""


class MarkerState(Message):
    """An event that another program told while this rig ran, such as one on LSL."""

    utc_ns: UtcNs
    """When it happened."""
    source: Annotated[str, Field(max_length=100)]
    """Who told it."""
    text: Annotated[str, Field(max_length=MAX_MARKER)]


class RecordingState(Message):
    """What a rig's recorder does."""

    utc_ns: UtcNs
    recording: bool
    name: str | None = None
    """Of the recording under way, or of the last one."""
    path: str | None = None
    """On the recorder's machine."""
    bytes_written: Count = 0
    seconds: FiniteFloat = 0.0
    blocks: Count = 0
    lost_blocks: Count = 0
    problem: str | None = None
    """Why the last recording ended, where nobody ended it."""
    refused_calls: Count = 0
    """Calls that were refused since the recorder started, the unreadable ones among them."""


class Fault(Message):
    """A typed fault, as `docs/safety.md` lists them."""

    kind: FaultKind
    reason: str
    utc_ns: UtcNs
    action: str
    """What an operator should do."""


class LeaseEnd(Message):
    """How the last lease ended."""

    owner: str
    """Who held it."""
    by: str | None = None
    """The client that ended it; None for a fault or a renewal that did not come."""
    reason: str
    utc_ns: UtcNs


class Counters(Message):
    """Counts since the rig started; they only grow."""

    blocks: Count = 0
    deadline_misses: Count = 0
    overruns: Count = 0
    underruns: Count = 0
    clipped_samples: Count = 0
    extrapolated_samples: Count = 0
    scaled_scenes: Count = 0
    stale_touches: Count = 0
    refused_commands: Count = 0
    stream_updates: Count = 0
    stream_updates_expired: Count = 0
    blocks_published: Count = 0
    blocks_dropped: Count = 0
    """Blocks that the publisher's bounded queue could not take."""
    lead_growths: Count = 0
    """How often the lead was made longer, at an arming after an underrun."""
    trips: Count = 0


class LoopTiming(Message):
    """How late the loop woke against its absolute deadlines, over the last seconds."""

    lateness_p50_ms: FiniteFloat = 0.0
    lateness_p99_ms: FiniteFloat = 0.0
    lateness_max_ms: FiniteFloat = 0.0
    """Since the rig started."""
    margin_min_ms: FiniteFloat = 0.0
    """Least output still queued when a block was handed over, over the last seconds."""


class AuxChannel(Message):
    """One channel of a rig's stream `aux`."""

    name: str
    unit: str


class RigStatus(Message):
    """What a rig is and how it fares; published at least every second."""

    site: str
    rig: str
    version: str
    run: Count
    utc_ns: UtcNs
    state: SafetyState
    fault: Fault | None = None
    owner: str | None = None
    """The client that holds the lease."""
    share_with: tuple[str, ...] = ()
    """Others whom the owner lets change what is rendered."""
    last_end: LeaseEnd | None = None
    """How the lease before ended; None where there was none since the rig started."""
    backend: str
    simulated: bool
    finger_source: Literal["touch", "pointer", "simulated"]
    finger_takeover: bool = False
    """Whether a client that may change what is rendered may take over the simulated finger."""
    finger_sensors: tuple[SensorName, ...] = ()
    """What the finger's motion is estimated from now."""
    sample_rate_hz: FiniteFloat
    block_samples: Count
    lead_ms: FiniteFloat
    """From handing a drive over to its playing, as it is now."""
    max_lead_ms: FiniteFloat | None = None
    """To which it may grow at an arming after an underrun; `lead_ms`: it is fixed."""
    screen_mm: tuple[FiniteFloat, FiniteFloat]
    screen_peak_v: FiniteFloat
    converter_steps: dict[str, Annotated[FiniteFloat, Field(gt=0.0)]] = {}
    """Value of one count of the converter behind a stream, in the stream's unit."""
    touch_latency_s: FiniteFloat | None = None
    """Declared age of a touch report when it arrives."""
    aux: tuple[AuxChannel, ...] = ()
    """What the channels of the stream `aux` are, in their order; none: no such stream."""
    model_etag: str
    model_placeholder: bool
    scene_etag: str
    compensation: Compensation = BY_MODEL
    """What its holder has chosen; `model` again once the lease has ended."""
    adaptation: AdaptationPolicy = "observe"
    """What a tracker may do with the model."""
    adaptations: Count = 0
    """How often the model was adapted since it was set."""
    stream_open: bool = False
    stream_stale: bool = False
    counters: Counters = Counters()
    timing: LoopTiming = LoopTiming()


class Applied(Message):
    """What the rig made of a scene; nothing is scaled in silence."""

    gain: FiniteFloat
    """Rendered friction over requested friction; below 1 the scene was scaled."""
    feasible_gain: FiniteFloat
    """Largest gain that fits the drive at all speeds."""
    bias: FiniteFloat
    """Drive fraction at zero texture."""
    bias_n: FiniteFloat
    """Mean friction that the bias adds, N."""
    scaled: bool
    speed_range_mm_s: tuple[FiniteFloat, FiniteFloat]
    """Speeds for which the gain holds."""
    notes: list[str] = []
    """What was rounded, cut or left out."""


class Tone(Message):
    """One component of an excitation."""

    hz: Annotated[FiniteFloat, Field(ge=0.01, le=5_000.0)]
    amplitude: Annotated[FiniteFloat, Field(ge=1e-9, le=0.5)]
    """Of the drive fraction."""
    phase_rad: PhaseRad = 0.0


class Excitation(Message):
    """A drive played as it is, without the inverse of any model: for calibration.

    ``m(t) = bias + sum(amplitude cos(2 pi hz t + phase))``, t = device sample / sample rate.
    It must stay within [0, 1]: the sum of the amplitudes decides, or, where `period_s` is
    given, one period of it.
    """

    tones: Annotated[list[Tone], Field(max_length=1_000)] = []
    bias: Annotated[FiniteFloat, Field(ge=0.0, le=1.0)] = 0.5
    period_s: Annotated[FiniteFloat, Field(ge=1e-3, le=10.0)] | None = None
    """Every tone is a multiple of its inverse."""


class SceneState(Message):
    """The active scene."""

    etag: str
    scene: Scene
    applied: Applied
    source: Literal["scene", "stream", "excitation"] = "scene"
    excitation: Excitation | None = None
    """Where the source is one."""
    utc_ns: UtcNs | None = None
    """When it was in force, by the rig's clock."""


class ModelState(Message):
    """The active friction model."""

    etag: str
    utc_ns: UtcNs | None = None
    """When it was in force, by the rig's clock."""
    model: Model
    not_rendered: dict[str, str] = {}
    """Effects of the model that the output does not make good, and why, by id."""
    adapted_from: str | None = None
    """Etag of the model that this one was adapted from while it played; None: it was set."""
    reason: Annotated[str, Field(max_length=MAX_REASON)] = ""
    """Why it was adapted, for people."""


class TimeState(Message):
    """The fit of the device's sample counter to UTC.

    ``utc_ns(sample) = utc_ns + (sample - this.sample) * ns_per_sample``, off by at most
    `uncertainty_ns` (95 %).
    """

    run: Count
    sample: Int64
    utc_ns: UtcNs
    ns_per_sample: FiniteFloat
    uncertainty_ns: Count
    skew_ppm: FiniteFloat
    """Rate of the device clock against this machine's, parts per million."""
    skew_uncertainty_ppm: Annotated[float, Field(ge=0.0, le=200.0)] | None = None
    """What `skew_ppm` may be off by (95 %); 200 until the fit has seen 1.6 s."""
    utc_steps: Count
    """How often this machine's UTC clock was stepped since the rig started."""

    def utc_of(self, sample: float) -> int:
        """Return the UTC, in ns, of a device sample index.

        Two rigs' samples are aligned by this, never by when they arrived.

        Parameters
        ----------
        sample : float
            Device sample index of the same `run`; fractions are instants between samples.
        """
        return self.utc_ns + round((sample - self.sample) * self.ns_per_sample)


class Interval(Message):
    """A value and its central 95 % interval."""

    value: FiniteFloat
    low: FiniteFloat
    high: FiniteFloat


class BandRatio(Message):
    """Measured friction over what the model in force predicts, in a band of a sixth octave."""

    centre_hz: FiniteFloat
    ratio_db: FiniteFloat
    half_width_db: FiniteFloat
    """Half of its 95 % interval."""


class LawNow(Message):
    """The law of the finger on the screen; a cutoff between the two is a straight line."""

    gain_n: Interval
    cutoff_20_hz: Interval
    """At 20 mm/s."""
    cutoff_100_hz: Interval
    """At 100 mm/s."""
    delay_us: Interval
    """Of the force channel against the drive: of the rig, not of the finger."""


class LawValues(Message):
    """A law without intervals: of a model that is, or was, in force."""

    gain_n: FiniteFloat
    cutoff_20_hz: FiniteFloat
    cutoff_100_hz: FiniteFloat


class ResponsePoint(Message):
    """Friction per drive as it was measured in the last 10 s of sliding, in one band."""

    speed_mm_s: FiniteFloat
    """Mean of the windows that it is made from."""
    centre_hz: FiniteFloat
    gain_n: FiniteFloat
    """Modulus."""
    half_width_db: FiniteFloat
    """Half of its 95 % interval."""
    phase_deg: FiniteFloat


class ModelChange(Message):
    """The model was adapted, or put back."""

    utc_ns: UtcNs
    etag_before: str
    etag_after: str
    before: LawValues
    after: LawValues
    reason: Annotated[str, Field(max_length=MAX_REASON)]


class EstimateState(Message):
    """What is known of the finger on the screen while any texture plays.

    A rendering that undoes a model has the error of `error_db`: measured over predicted
    friction of the last 10 s of sliding, dB rms over bands, on windows not used for it.
    """

    utc_ns: UtcNs
    run: Count
    participant: Annotated[str, Field(max_length=64)] | None = None
    """Pseudonym of whom the prior is of; None: of nobody in particular."""
    windows: Count
    """Of 0.1 s, half overlapping, that the estimate is made from."""
    refused: Annotated[dict[str, Count], Field(max_length=32)] = {}
    """Windows that could not be used, by the reason."""
    new_fingers: Count = 0
    """How often the finger became another without notice, and the estimate began anew."""
    model_etag: str = ""
    """Of the model in force that it is compared with."""
    law: LawNow | None = None
    """None until something was felt."""
    model: Model | None = None
    """The estimate as a document, as a registry takes it; None where there is none yet."""
    in_force: LawValues | None = None
    """The law that the rig inverts; None where it has another form."""
    points: Annotated[tuple[ResponsePoint, ...], Field(max_length=128)] = ()
    bands: Annotated[tuple[BandRatio, ...], Field(max_length=64)] = ()
    error_db: Annotated[dict[str, FiniteFloat], Field(max_length=8)] = {}
    """Of `in_force`, of `first`, in force when it began, and of `newest`, the estimate."""
    gain_nats: Annotated[dict[str, FiniteFloat], Field(max_length=8)] = {}
    """Log-likelihood of `in_force` and of `newest` over that of `first`, all windows so far,
    each predicted before it was used."""
    evidence: Annotated[dict[str, FiniteFloat], Field(max_length=64)] = {}
    """Against the model in force by cause, nats; at `alarm_nats` it is wrong. `unknown`: by
    anything that no cause is."""
    alarm_nats: FiniteFloat = 0.0
    alarms: Annotated[tuple[str, ...], Field(max_length=64)] = ()
    """Causes whose evidence has ever reached it under this model."""
    advice: Annotated[dict[str, str], Field(max_length=64)] = {}
    """What to do about each alarm, with its size so far or, of `unknown`, where it is."""
    policy: AdaptationPolicy = "observe"
    held_back: Annotated[str, Field(max_length=MAX_REASON)] = ""
    """Why the model stays as it is; empty where the estimate would be put in force."""
    changes: Annotated[tuple[ModelChange, ...], Field(max_length=16)] = ()
    """The newest, oldest first."""


class Request(Message):
    """What every call carries."""

    client: Annotated[str, Field(min_length=1, max_length=64)]
    utc_ns: UtcNs
    ttl_ms: Annotated[int, Field(gt=0, le=60_000)] = 1_000


class ArmRequest(Request):
    """Take the rig and let it drive the screen while the lease is renewed."""

    lease_ms: Annotated[int, Field(ge=100, le=10_000)] = 500
    share_with: Annotated[tuple[ClientName, ...], Field(max_length=16)] = ()
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
        Field(min_length=1, max_length=100, pattern=r"^[A-Za-z0-9._-]+$"),
        AfterValidator(of_a_file),
    ]
    """Of the file, too: it ends without a dot and is no device of Windows, such as ``nul``."""
    participant: Annotated[str, Field(max_length=64)] | None = None
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


MESSAGES: Final[dict[str, type[Message]]] = {
    kind.__name__: kind
    for kind in (
        FingerState,
        TouchState,
        GuidanceState,
        MarkerState,
        RecordingState,
        RigStatus,
        SceneState,
        ModelState,
        TimeState,
        EstimateState,
        ArmRequest,
        Request,
        SceneRequest,
        OpenStreamRequest,
        ModelRequest,
        AdaptationRequest,
        AdaptRequest,
        ExciteRequest,
        CompensationRequest,
        RecordRequest,
        LeaseRenewal,
        PointerState,
        Reply,
    )
}
"""Every JSON message by the name that the table of keys gives it."""
