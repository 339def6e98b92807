"""Configuration of a recording played as a rig."""

from pathlib import Path
from typing import Literal, Self

from pydantic import Field

from frictus_hardware.arguments import StrictModel
from frictus_hardware.simulated.clock import ClockSetting


class ReplayConfig(StrictModel):
    """A recording that plays as a rig.

    Lead, screen, limit of the output and latency of the touch sensor are the recorded rig's.

    Attributes
    ----------
    file : Path
        Of `replay/1`, as `frictus export RECORDING --to replay` makes it.
    sample_rate_hz : float
        At which it was recorded; the file has to agree.
    clock : "real", "virtual" or float
        A number, 0.01 to 100, plays that many times faster than real time; the virtual clock
        plays as fast as the rig is asked, and nothing is ever late.
    at_end : "stop" or "loop"
        Whether the device is lost where the recording ends, or plays it again.
    """

    kind: Literal["replay"] = "replay"
    file: Path
    sample_rate_hz: float = Field(default=20_000.0, ge=1_000.0, le=200_000.0)
    clock: ClockSetting = "real"
    at_end: Literal["stop", "loop"] = "stop"

    def within(self, folder: Path) -> Self:
        """Return this configuration with a relative file made relative to `folder`."""
        return self.model_copy(update={"file": folder / self.file})
