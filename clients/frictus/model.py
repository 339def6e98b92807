"""`model/1`: how a finger-screen model is stored and carried, and in which mode it is inverted.

The client validates and carries a model; the equations stand once, in
`frictus_hardware.physics`.
"""

import math
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from frictus.lenient import LISTED, Lenient
from frictus.textures import SpeedMmS

Bound = Annotated[FiniteFloat, Field(ge=0.0, le=100_000.0)]
Range = Annotated[tuple[Bound, Bound], LISTED]
Value = Annotated[FiniteFloat, Field(ge=-1e15, le=1e15)]
MAX_EFFECTS = 64
MAX_DEPTH: Final = 32
"""Levels of lists and objects in a document."""


class _Carried(BaseModel):
    """Lenient to what newer writers add, and keeps it."""

    model_config = ConfigDict(extra="allow", frozen=True, populate_by_name=True)


class FirstOrderSpeedLaw(_Carried):
    """Friction response ``g w0 / (s + w0)``, ``w0 = 2 pi (cutoff_0 + slope |v|)``."""

    law: Literal["first_order_speed"] = "first_order_speed"
    gain_n: Annotated[FiniteFloat, Field(ge=1e-6, le=50.0)]
    """Friction per unit of drive fraction, N."""
    cutoff_0_hz: Annotated[FiniteFloat, Field(ge=1e-3, le=20_000.0)]
    slope_hz_per_mm_s: Annotated[FiniteFloat, Field(ge=-1_000.0, le=1_000.0)]


class MassSpringDamper(_Carried):
    """Finger mobility ``s / (m s^2 + b s + k)``, friction force to skin velocity."""

    law: Literal["mass_spring_damper"] = "mass_spring_damper"
    mass_kg: Annotated[FiniteFloat, Field(ge=1e-9, le=10.0)]
    damping_n_s_m: Annotated[FiniteFloat, Field(ge=0.0, le=1e6)]
    stiffness_n_m: Annotated[FiniteFloat, Field(ge=1e-6, le=1e9)]


class Effect(_Carried):
    """An effect that extends the base law; ids are open strings on the wire."""

    id: Annotated[str, Field(min_length=1, max_length=100)]
    parameters: Annotated[dict[str, Value], Field(max_length=MAX_EFFECTS)] = {}


class Validity(_Carried):
    """Where the model was measured; at other speeds its use is flagged as extrapolated."""

    speed_mm_s: Range = (20.0, 100.0)
    normal_force_n: Range = (0.2, 0.6)
    drive_vpp: Range = (150.0, 150.0)

    @model_validator(mode="after")
    def _ordered(self) -> "Validity":
        for name in ("speed_mm_s", "normal_force_n", "drive_vpp"):
            low, high = getattr(self, name)
            if not 0.0 <= low <= high:
                raise ValueError(f"{name} must be [low, high] with 0 <= low <= high")
        return self


class Covariance(_Carried):
    """Covariance of the base parameters, in the order and units of `parameters`."""

    parameters: Annotated[list[str], Field(max_length=MAX_EFFECTS)]
    matrix: Annotated[
        list[Annotated[list[Value], Field(max_length=MAX_EFFECTS)]],
        Field(max_length=MAX_EFFECTS),
    ]


class Model(_Carried):
    """A `model/1` document."""

    schema_: Annotated[Literal["model/1"], Field(alias="schema")] = "model/1"
    response: Literal["friction", "mobility"] = "friction"
    base: Annotated[FirstOrderSpeedLaw | MassSpringDamper, Field(discriminator="law")]
    input_definition: Literal["drive_fraction"] = "drive_fraction"
    """`drive_fraction`: the input is m in [0, 1], screen volts are V_pk sqrt(m) cos."""
    hold_s: Annotated[FiniteFloat, Field(ge=0.0, le=1.0)] = 5e-5
    """How long one output sample is held; belongs to the base model."""
    skew_s: Annotated[FiniteFloat, Field(ge=-10.0, le=10.0)] = 0.0
    validity: Validity = Validity()
    effects: Annotated[list[Effect], Field(max_length=MAX_EFFECTS)] = []
    covariance: Covariance | None = None
    participant: str | None = None
    """Pseudonym; None for a population model."""
    placeholder: bool = False
    """True where nobody measured: every message that uses it says so."""
    provenance: dict[str, Any] = {}

    @model_validator(mode="after")
    def _representable(self) -> "Model":
        # What is only carried is of any type; some of it could not be written, or read, again.
        if not _all_representable(self.model_dump(), MAX_DEPTH):
            raise ValueError(
                "NaN, infinities, integers beyond 64 bits, text that is not Unicode and more "
                f"than {MAX_DEPTH} levels of nesting are not accepted, provenance included"
            )
        return self

    @model_validator(mode="after")
    def _consistent(self) -> "Model":
        if (self.response == "friction") != isinstance(self.base, FirstOrderSpeedLaw):
            raise ValueError(
                f"response {self.response!r} does not go with base law {self.base.law!r}"
            )
        if isinstance(self.base, FirstOrderSpeedLaw):
            for speed in self.validity.speed_mm_s:
                if self.base.cutoff_0_hz + self.base.slope_hz_per_mm_s * speed <= 0.0:
                    raise ValueError(
                        f"the cutoff is not positive at {speed:g} mm/s, "
                        "inside the declared validity"
                    )
        return self

    @property
    def simulated(self) -> bool:
        """Whether a simulated rig measured it, as its provenance says; it may not know."""
        return self.provenance.get("simulated") is True

    def to_json(self) -> bytes:
        """Return the document as JSON bytes."""
        return self.model_dump_json(by_alias=True).encode()


def _all_representable(value: object, levels: int) -> bool:
    if isinstance(value, dict):
        value = [*value, *value.values()]
    if isinstance(value, list | tuple):
        return levels > 0 and all(_all_representable(item, levels - 1) for item in value)
    if isinstance(value, str):
        return value.encode(errors="ignore").decode() == value  # no half of a surrogate pair
    if isinstance(value, int):
        return -(2**63) <= value < 2**63
    return not isinstance(value, float) or math.isfinite(value)


CompensationMode = Literal["model", "fixed", "none"]


class Compensation(Lenient):
    """What is inverted between the friction that is asked for and the drive.

    `model` inverts the friction model at the finger's predicted speed, `fixed` the same model
    at one speed, however fast the finger moves, and `none` inverts nothing: friction is turned
    into drive by the model's gain alone.
    """

    mode: CompensationMode
    speed_mm_s: SpeedMmS | None = None
    """At which the model is inverted in mode `fixed`; None in the others."""

    @model_validator(mode="after")
    def _speed_where_it_counts(self) -> "Compensation":
        if self.mode == "fixed" and self.speed_mm_s is None:
            raise ValueError("mode 'fixed' takes speed_mm_s, 1 to 1000 mm/s: give it")
        if self.mode != "fixed" and self.speed_mm_s is not None:
            raise ValueError(
                f"speed_mm_s is of mode 'fixed' alone: leave it out with {self.mode!r}"
            )
        return self

    def __str__(self) -> str:
        """Return it as the command line takes it: ``model``, ``fixed:60`` or ``none``."""
        return self.mode if self.speed_mm_s is None else f"{self.mode}:{self.speed_mm_s:g}"


BY_MODEL: Final = Compensation(mode="model")
"""What holds unless the holder of the rig has chosen another."""
