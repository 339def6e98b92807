"""A virtual finger that follows points sent by a client, such as a mouse."""

import math
from typing import Literal

import numpy as np
from pydantic import Field

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.motion import FingerMotion
from frictus_hardware.simulated.strict import StrictModel


class ClientFinger(StrictModel):
    """The finger glides to the newest point that a client sent.

    Attributes
    ----------
    smoothing_hz : float
        Corner of the critically damped follower: points at 60 Hz become a continuous path that
        lags by ``1 / (pi smoothing_hz)``, 40 ms at 8 Hz.
    """

    kind: Literal["client"] = "client"
    smoothing_hz: float = Field(default=8.0, gt=0.0, le=100.0)

    def start(
        self, screen_mm: tuple[float, float], rng: np.random.Generator
    ) -> "PointerFinger":
        """Return the finger, off the screen until a first point comes."""
        return PointerFinger(screen_mm, self.smoothing_hz)


class PointerFinger:
    """Follows a target in (x mm, y mm, N), without overshoot.

    `push` may be called from any thread; `at` from one, with times that only increase.
    """

    def __init__(self, screen_mm: tuple[float, float], smoothing_hz: float) -> None:
        self._screen_mm = screen_mm
        self._corner_rad_s = 2.0 * math.pi * smoothing_hz
        # Replaced as a whole, so that a reader in another thread never sees half a point.
        self._target = (screen_mm[0] / 2.0, screen_mm[1] / 2.0, 0.0)
        self._pressed = False
        self._time_s = 0.0
        self._value = np.array(self._target)
        self._rate = np.zeros(3)

    def push(self, x_mm: float, y_mm: float, in_contact: bool, normal_force_n: float) -> None:
        """Set where the finger shall go.

        Parameters
        ----------
        x_mm, y_mm : float
            Taken to the nearest place on the screen.
        in_contact : bool
            Whether the finger touches the screen.
        normal_force_n : float
            0 to 5.

        Raises
        ------
        ConfigError
            If a number is not finite, or the force out of its range.
        """
        if not (math.isfinite(x_mm) and math.isfinite(y_mm) and 0.0 <= normal_force_n <= 5.0):
            raise ConfigError(
                f"point ({x_mm}, {y_mm}) mm with {normal_force_n} N: "
                "finite millimetres and 0 to 5 N accepted"
            )
        width, height = self._screen_mm
        self._target = (
            min(max(x_mm, 0.0), width),
            min(max(y_mm, 0.0), height),
            normal_force_n if in_contact else 0.0,
        )

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at given times, gliding towards the newest point.

        Critically damped: ``p = target + (c + (r + w c) t) exp(-w t)``, exact whatever the
        spacing of the times.
        """
        target = np.array(self._target)
        pressed = bool(target[2] > 0.0)
        if pressed and not self._pressed:  # it lands where the client put it
            self._value = np.array([target[0], target[1], 0.0])
            self._rate = np.zeros(3)
        self._pressed = pressed
        elapsed = (np.asarray(time_s) - self._time_s)[:, np.newaxis]
        corner = self._corner_rad_s
        offset = self._value - target
        slope = self._rate + corner * offset
        decay = np.exp(-corner * elapsed)
        value = target + (offset + slope * elapsed) * decay
        rate = (slope - corner * (offset + slope * elapsed)) * decay
        self._time_s = float(time_s[-1])
        self._value, self._rate = value[-1].copy(), rate[-1].copy()
        touching = np.full(len(time_s), pressed)
        force = np.maximum(value[:, 2], 0.0) * touching
        return FingerMotion(value[:, :2], rate[:, :2], force, touching)
