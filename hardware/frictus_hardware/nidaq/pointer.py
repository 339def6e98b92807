"""A declared substitute for a touch sensor: points that a client sends, such as a mouse's."""

import math
from typing import Final, Literal

from frictus_hardware.base import TouchReport
from frictus_hardware.errors import ConfigError

REPORTS_HZ: Final = 60.0


class PointerSource:
    """See `frictus_hardware.nidaq.touch.TouchSource`.

    Reports the newest point 60 times a second. `push` may be called from any thread.

    Parameters
    ----------
    screen_mm : tuple of float
        Width and height.
    sample_rate_hz : float
        Of the device.
    latency_s : float
        Declared age of a point when it arrives.
    """

    finger_source: Literal["pointer"] = "pointer"

    def __init__(
        self, screen_mm: tuple[float, float], sample_rate_hz: float, latency_s: float
    ) -> None:
        self.latency_s = latency_s
        self._screen_mm = screen_mm
        self._rate_hz = sample_rate_hz
        self._point: tuple[float, float, bool] | None = None
        self._reports = 0

    def push(self, x_mm: float, y_mm: float, in_contact: bool) -> None:
        """Take a point.

        Parameters
        ----------
        x_mm, y_mm : float
            Taken to the nearest place on the screen.
        in_contact : bool

        Raises
        ------
        ConfigError
            If a number is not finite.
        """
        if not (math.isfinite(x_mm) and math.isfinite(y_mm)):
            raise ConfigError(f"point ({x_mm}, {y_mm}) mm: finite millimetres accepted")
        width, height = self._screen_mm
        # Replaced as a whole, so that no reader sees half a point.
        self._point = (min(max(x_mm, 0.0), width), min(max(y_mm, 0.0), height), in_contact)

    def start(self) -> None:
        """Begin with device sample 0; the finger is nowhere until a point comes."""
        self._point = None
        self._reports = 0

    def arrived(self, first_sample: int, n_samples: int) -> tuple[TouchReport, ...]:
        """Return the reports that are due in these samples."""
        reports = []
        period = self._rate_hz / REPORTS_HZ
        while (due := self._reports * period) < first_sample + n_samples:
            self._reports += 1
            if self._point is not None:
                measured = due - self.latency_s * self._rate_hz
                reports.append(TouchReport(measured, *self._point))
        return tuple(reports)

    def health(self) -> str | None:
        """Return None: a pointer that does not move is a pointer."""
        return None

    def stop(self) -> None:
        """Do nothing."""
