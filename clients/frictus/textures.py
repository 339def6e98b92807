"""Textures and scenes: what friction the finger should feel, and where.

A texture is friction in newtons over position (spatial) or over time (temporal). Friction is
relative: the rig adds the bias that keeps its drive within range and reports the gain that it
could apply.
"""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, model_validator

from frictus.lenient import LISTED, Lenient

MAX_COMPONENTS = 4096
MAX_PROFILE_SAMPLES = 65_536
MAX_REGIONS = 32
MAX_MAP_PIXELS = 262_144
BAND_HZ = (20.0, 1000.0)

Friction = Annotated[FiniteFloat, Field(ge=-10.0, le=10.0)]
Amplitude = Annotated[FiniteFloat, Field(ge=0.0, le=10.0)]
RmsFriction = Annotated[FiniteFloat, Field(ge=1e-6, le=10.0)]
Hertz = Annotated[FiniteFloat, Field(ge=0.01, le=10_000.0)]
CyclesPerMm = Annotated[FiniteFloat, Field(ge=1e-3, le=1_000.0)]
PhaseRad = Annotated[FiniteFloat, Field(ge=-10_000.0, le=10_000.0)]
SpeedMmS = Annotated[FiniteFloat, Field(ge=1.0, le=1_000.0)]
AngleDeg = Annotated[FiniteFloat, Field(ge=-360.0, le=360.0)]
PositionMm = Annotated[FiniteFloat, Field(ge=-10_000.0, le=10_000.0)]
SpanMm = Annotated[tuple[PositionMm, PositionMm], LISTED]
PERIOD_MM = (1e-3, 1_000.0)
"""Accepted periods of a spatial texture, mm."""
PERIOD_S = (1e-4, 10.0)
"""Accepted periods of a temporal texture, s."""
Seed = Annotated[int, Field(ge=0, lt=2**63)]


class Component(Lenient):
    """One sinusoid, ``amplitude_n cos(2 pi f t + phase_rad)``, over position or time."""

    amplitude_n: Amplitude
    cycles_per_mm: CyclesPerMm | None = None
    hz: Hertz | None = None
    phase_rad: PhaseRad = 0.0

    @model_validator(mode="after")
    def _one_frequency(self) -> "Component":
        if (self.cycles_per_mm is None) == (self.hz is None):
            raise ValueError("give either cycles_per_mm or hz, not both and not neither")
        return self


class Spectrum(Lenient):
    """A sum of sinusoids, spatial (`cycles_per_mm`) and temporal (`hz`) ones alike."""

    kind: Literal["spectrum"] = "spectrum"
    components: Annotated[
        list[Component], Field(min_length=1, max_length=MAX_COMPONENTS, fail_fast=True)
    ]
    angle_deg: AngleDeg = 0.0
    """Direction of the spatial phase, from x towards y."""
    label: Annotated[str, Field(max_length=500)] = ""
    """What somebody should know of it, such as that it was made of something else than
    friction; a rig that plays it says so among the notes of its scene."""


class Profile(Lenient):
    """Friction over one period, sampled evenly; it repeats without end."""

    kind: Literal["profile"] = "profile"
    friction_n: Annotated[
        list[Friction], Field(min_length=2, max_length=MAX_PROFILE_SAMPLES, fail_fast=True)
    ]
    period_mm: Annotated[FiniteFloat, Field(ge=PERIOD_MM[0], le=PERIOD_MM[1])] | None = None
    period_s: Annotated[FiniteFloat, Field(ge=PERIOD_S[0], le=PERIOD_S[1])] | None = None
    angle_deg: AngleDeg = 0.0

    @model_validator(mode="after")
    def _one_period(self) -> "Profile":
        if (self.period_mm is None) == (self.period_s is None):
            raise ValueError("give either period_mm or period_s, not both and not neither")
        return self


class Beta(Lenient):
    """Amplitude ``scale BetaPDF(x; alpha, beta)``, ``x = log10(f/20) / log10(50)``.

    Components stand at 1/24-octave steps over 20 to 1000 Hz, with random phases from `seed`,
    then the whole is scaled to `rms_n`. With `speed_mm_s` the frequencies are those felt at
    that speed and the texture is spatial; without, it is temporal.
    """

    kind: Literal["beta"] = "beta"
    alpha: Annotated[FiniteFloat, Field(ge=1e-3, le=1_000.0)]
    beta: Annotated[FiniteFloat, Field(ge=1e-3, le=1_000.0)]
    rms_n: RmsFriction
    scale: Annotated[FiniteFloat, Field(ge=1e-9, le=1e9)] = 1.0
    seed: Seed = 0
    speed_mm_s: SpeedMmS | None = None
    angle_deg: AngleDeg = 0.0


class Slope(Lenient):
    """White noise through Butterworth high- and low-pass filters that meet at `peak_hz`.

    With `speed_mm_s` the frequencies are those felt at that speed and the texture is
    spatial; without, it is temporal.
    """

    kind: Literal["slope"] = "slope"
    peak_hz: Annotated[FiniteFloat, Field(ge=BAND_HZ[0], le=BAND_HZ[1])]
    low_order: Annotated[int, Field(ge=1, le=8)]
    """Order of the high-pass: the slope below the peak."""
    high_order: Annotated[int, Field(ge=1, le=8)]
    """Order of the low-pass: the slope above the peak."""
    rms_n: RmsFriction
    seed: Seed = 0
    speed_mm_s: SpeedMmS | None = None
    angle_deg: AngleDeg = 0.0


class Map(Lenient):
    """A grey image laid over its region: friction per grey level.

    `image_png` is a base64 PNG of at most 262 144 pixels; its first row is the region's
    smallest y. Grey 0 feels like `black_n`, full grey like `white_n`.
    """

    kind: Literal["map"] = "map"
    image_png: Annotated[str, Field(min_length=4, max_length=8_000_000)]
    black_n: Friction = 0.0
    white_n: Friction


Texture = Annotated[Spectrum | Profile | Beta | Slope | Map, Field(discriminator="kind")]


class Region(Lenient):
    """A rectangle of the screen that feels like `texture`; overlapping regions add."""

    texture: Texture
    x_mm: SpanMm = (-1_000.0, 1_000.0)
    """From, to. The default reaches past any screen and is cut to it."""
    y_mm: SpanMm = (-1_000.0, 1_000.0)
    gain: Annotated[FiniteFloat, Field(ge=0.0, le=100.0)] = 1.0
    edge_fade_mm: Annotated[FiniteFloat, Field(ge=0.0, le=50.0)] = 1.0
    """Width over which the texture fades in from the edge; 0 is taken as 0.1 mm."""
    name: Annotated[str, Field(max_length=100)] = ""

    @model_validator(mode="after")
    def _not_empty(self) -> "Region":
        for axis in ("x_mm", "y_mm"):
            low, high = getattr(self, axis)
            if not low < high:
                raise ValueError(f"{axis} must be [from, to] with from < to, not {low}, {high}")
        return self


class Scene(Lenient):
    """What a whole screen feels like. No region at all is a smooth screen."""

    regions: list[Region] = Field(default=[], max_length=MAX_REGIONS, fail_fast=True)
    name: Annotated[str, Field(max_length=100)] = ""
