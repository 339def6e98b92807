"""What a rig and its recorder publish of themselves."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from frictus.messages.base import (
    MAX_MARKER,
    MAX_REASON,
    AdaptationPolicy,
    Count,
    DurationMs,
    FaultKind,
    ForceN,
    Int64,
    LengthS,
    Message,
    SafetyState,
    UtcNs,
    VelocityMmS,
)
from frictus.model import BY_MODEL, Compensation, Model, Range
from frictus.textures import PhaseRad, PositionMm, Scene, SpanMm

SensorName = Literal["touch", "acceleration", "force"]


class FingerState(Message):
    """Where the finger is and how it moves, as the sensors say it."""

    sequence: Count
    sample: Int64
    """Device sample index this state holds for."""
    utc_ns: UtcNs
    uncertainty_ns: Count
    x_mm: PositionMm
    y_mm: PositionMm
    vx_mm_s: VelocityMmS
    vy_mm_s: VelocityMmS
    normal_force_n: ForceN
    in_contact: bool
    source: Literal["touch", "pointer", "simulated"]
    age_ms: DurationMs
    """Age of the touch report behind this state."""
    stale: bool
    extrapolated: bool
    """Speed outside the model's validity: the compensation used the nearest valid speed."""


class TouchState(Message):
    """One report of the touch sensor as it came, before any prediction."""

    run: Count
    sample: Annotated[FiniteFloat, Field(ge=-(2.0**63), le=2.0**63)]
    """Device sample index at which the finger was there; a report arrives later than that."""
    x_mm: PositionMm
    y_mm: PositionMm
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
    speed_mm_s: VelocityMmS | None = None
    """Actual; None where the finger is not seen."""
    force_n: ForceN | None = None
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
    seconds: LengthS = 0.0
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


class LastCall(Message):
    """Who last had a call of a name accepted."""

    client: str
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

    lateness_p50_ms: DurationMs = 0.0
    lateness_p99_ms: DurationMs = 0.0
    lateness_max_ms: DurationMs = 0.0
    """Since the rig started."""
    margin_min_ms: DurationMs = 0.0
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
    last_calls: dict[str, LastCall] = {}
    """By the name of a call that changes the rig, and of `stop`, also of one where nothing was
    driven; of leases `owner` and `last_end` tell. None was accepted since the rig started: it
    is not in it."""
    backend: str
    simulated: bool
    finger_source: Literal["touch", "pointer", "simulated"]
    finger_takeover: bool = False
    """Whether a client that may change what is rendered may take over the simulated finger."""
    finger_sensors: tuple[SensorName, ...] = ()
    """What the finger's motion is estimated from now."""
    sample_rate_hz: Annotated[float, Field(gt=0.0, le=1e6)]
    block_samples: Count
    lead_ms: DurationMs
    """From handing a drive over to its playing, as it is now."""
    max_lead_ms: DurationMs | None = None
    """To which it may grow at an arming after an underrun; `lead_ms`: it is fixed."""
    screen_mm: SpanMm
    screen_peak_v: Annotated[FiniteFloat, Field(ge=0.0, le=1e5)]
    force_limit_n: Annotated[FiniteFloat, Field(gt=0.0, le=1_000.0)] | None = None
    """A force on the screen, of any direction, beyond which the rig trips; None: not said."""
    converter_steps: dict[str, Annotated[FiniteFloat, Field(gt=0.0, le=1e6)]] = {}
    """Value of one count of the converter behind a stream, in the stream's unit."""
    touch_latency_s: LengthS | None = None
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


Gain = Annotated[FiniteFloat, Field(ge=0.0, le=1e9)]


class Applied(Message):
    """What the rig made of a scene; nothing is scaled in silence."""

    gain: Gain
    """Rendered friction over requested friction; below 1 the scene was scaled."""
    feasible_gain: Gain
    """Largest gain that fits the drive at all speeds."""
    bias: Annotated[FiniteFloat, Field(ge=0.0, le=1.0)]
    """Drive fraction at zero texture."""
    bias_n: ForceN
    """Mean friction that the bias adds, N."""
    scaled: bool
    speed_range_mm_s: Range
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
    ns_per_sample: Annotated[FiniteFloat, Field(ge=1.0, le=1e9)]
    """1 Hz to 1 GHz."""
    uncertainty_ns: Count
    skew_ppm: Annotated[FiniteFloat, Field(ge=-1e6, le=1e6)]
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
