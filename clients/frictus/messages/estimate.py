"""What a tracker has learned of the finger on a rig, and what its model is worth."""

from typing import Annotated, Final

from pydantic import Field, FiniteFloat

from frictus.messages.base import (
    MAX_REASON,
    AdaptationPolicy,
    Count,
    Decibel,
    ForceN,
    FrequencyHz,
    Message,
    UtcNs,
    VelocityMmS,
)
from frictus.model import Model, Value

MAX_CHANGES: Final = 16
"""Changes of the model that an estimate tells: the newest."""


class Interval(Message):
    """A value and its central 95 % interval."""

    value: Value
    low: Value
    high: Value


class BandRatio(Message):
    """Measured friction over what the model in force predicts, in a band of a sixth octave."""

    centre_hz: FrequencyHz
    ratio_db: Decibel
    half_width_db: Decibel
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

    gain_n: ForceN
    cutoff_20_hz: Value
    cutoff_100_hz: Value


class ResponsePoint(Message):
    """Friction per drive as it was measured in the last 10 s of sliding, in one band."""

    speed_mm_s: VelocityMmS
    """Mean of the windows that it is made from."""
    centre_hz: FrequencyHz
    gain_n: ForceN
    """Modulus."""
    half_width_db: Decibel
    """Half of its 95 % interval."""
    phase_deg: Annotated[FiniteFloat, Field(ge=-1e6, le=1e6)]


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
    error_db: Annotated[dict[str, Decibel], Field(max_length=8)] = {}
    """Of `in_force`, of `first`, in force when it began, and of `newest`, the estimate."""
    gain_nats: Annotated[dict[str, Value], Field(max_length=8)] = {}
    """Log-likelihood of `in_force` and of `newest` over that of `first`, all windows so far,
    each predicted before it was used."""
    evidence: Annotated[dict[str, Value], Field(max_length=64)] = {}
    """Against the model in force by cause, nats; at `alarm_nats` it is wrong. `unknown`: by
    anything that no cause is."""
    alarm_nats: Value = 0.0
    alarms: Annotated[tuple[str, ...], Field(max_length=64)] = ()
    """Causes whose evidence has ever reached it under this model."""
    advice: Annotated[dict[str, str], Field(max_length=64)] = {}
    """What to do about each alarm, with its size so far or, of `unknown`, where it is."""
    policy: AdaptationPolicy = "observe"
    held_back: Annotated[str, Field(max_length=MAX_REASON)] = ""
    """Why the model stays as it is; empty where the estimate would be put in force."""
    changes: Annotated[tuple[ModelChange, ...], Field(max_length=MAX_CHANGES)] = ()
    """The newest, oldest first."""
