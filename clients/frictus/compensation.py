"""How a rig makes up for what finger and screen do to a texture: its compensation mode."""

from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, model_validator

from frictus.textures import SpeedMmS

CompensationMode = Literal["model", "fixed", "none"]


class Compensation(BaseModel):
    """What is inverted between the friction that is asked for and the drive.

    `model` inverts the friction model at the finger's predicted speed, `fixed` the same model
    at one speed, however fast the finger moves, and `none` inverts nothing: friction is turned
    into drive by the model's gain alone.
    """

    model_config = ConfigDict(extra="ignore", frozen=True)

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
