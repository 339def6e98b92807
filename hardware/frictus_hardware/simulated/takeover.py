"""A virtual finger that strokes by itself until a client or guidance takes it over."""

from collections import deque
from dataclasses import replace
from typing import Final, Literal

import numpy as np
from pydantic import Field

from frictus_hardware.arguments import StrictModel
from frictus_hardware.arrays import FloatArray
from frictus_hardware.simulated.guided import GuidedFinger, GuidedStrokes, PointerFinger
from frictus_hardware.simulated.motion import FingerMotion, least_jerk
from frictus_hardware.simulated.strokes import SteadyFinger, SteadyStrokes

LIFT_S: Final = 0.1
"""Off the screen between two hands: no finger is in two places at once."""
LAND_S: Final = 0.05
"""From touching the screen to the whole force."""
SILENT_S: Final = 2.0
"""A client that touches and sends no point for so long has let go."""
RESTED_S: Final = 5.0
"""Guidance that has asked for no speed for so long is over."""
FORGOTTEN_S: Final = 60.0
"""Guidance to move that has not changed for so long is nobody's any more."""

Hand = Literal["own", "client", "guidance"]


class TakeoverStrokes(StrictModel):
    """Steady strokes until a client touches the screen, and again once it lets go.

    A calibration or an experiment guides it as a participant, while no client touches.

    Attributes
    ----------
    strokes : SteadyStrokes
        What the finger does by itself. They stand still while it is taken over.
    smoothing_hz : float
        How closely the finger follows a client, as of `ClientFinger`.
    """

    kind: Literal["takeover"] = "takeover"
    strokes: SteadyStrokes = SteadyStrokes()
    smoothing_hz: float = Field(default=8.0, gt=0.0, le=100.0)

    def start(
        self, screen_mm: tuple[float, float], rng: np.random.Generator
    ) -> "TakeoverFinger":
        """Return the finger, stroking.

        Raises
        ------
        ConfigError
            If the strokes do not fit the screen.
        """
        return TakeoverFinger(
            self.strokes.start(screen_mm, rng),
            PointerFinger(screen_mm, self.smoothing_hz),
            GuidedStrokes().start(screen_mm, rng),
        )


class TakeoverFinger:
    """See `TakeoverStrokes`.

    `push` and `guide` may be called from any thread; `at` from one, with times that only
    increase.
    """

    def __init__(
        self, strokes: SteadyFinger, pointer: PointerFinger, guided: GuidedFinger
    ) -> None:
        self._strokes = strokes
        self._pointer = pointer
        self._guided = guided
        self._touches: deque[bool] = deque(maxlen=64)
        self._taken = False
        self._heard_s = 0.0
        self._guidance: deque[bool] = deque(maxlen=64)
        self._moves = False
        self._guided_s = -np.inf
        self._hand: Hand = "own"
        self._lands_s = -np.inf
        self._paused_s = 0.0
        """By how much the strokes' own time is behind the device's."""
        self._stopped_s = 0.0
        """The strokes' own time while they stand still."""

    def push(self, x_mm: float, y_mm: float, in_contact: bool, normal_force_n: float) -> None:
        """Take the finger over, move it, or let go of it.

        Parameters
        ----------
        x_mm, y_mm : float
            Taken to the nearest place on the screen.
        in_contact : bool
            False lets go.
        normal_force_n : float
            0 to 5.

        Raises
        ------
        ConfigError
            If a number is not finite, or the force out of its range.
        """
        self._pointer.push(x_mm, y_mm, in_contact, normal_force_n)
        self._touches.append(in_contact)

    def guide(self, speed_mm_s: float, force_n: float, span_mm: tuple[float, float]) -> None:
        """Tell it what a participant is asked to do, as `GuidedFinger.push`.

        Parameters
        ----------
        speed_mm_s : float
            0 to 200; 0: rest.
        force_n : float
            0.05 to 5.
        span_mm : tuple of float
            Ends of the strokes along x.

        Raises
        ------
        ConfigError
            If a number is not finite or out of its range.
        """
        self._guided.push(speed_mm_s, force_n, span_mm)
        self._guidance.append(speed_mm_s > 0.0)

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at given times, none before the last ones asked for."""
        time_s = np.asarray(time_s, dtype=np.float64)
        self._change_hands(float(time_s[0]))
        # Until it lands, it waits above the place where it will.
        then_s = np.maximum(time_s, self._lands_s)
        if self._hand == "guidance":
            motion = self._guided.at(then_s)
        else:
            self._guided.at(time_s[-1:])  # it rests meanwhile, and reacts from now on
            motion = (
                self._pointer.at(then_s)
                if self._hand == "client"
                else self._strokes.at(then_s - self._paused_s)
            )
        landed, _ = least_jerk(np.clip((time_s - self._lands_s) / LAND_S, 0.0, 1.0))
        on = landed > 0.0
        return replace(
            motion,
            velocity_mm_s=motion.velocity_mm_s * on[:, np.newaxis],
            normal_force_n=motion.normal_force_n * landed,
            in_contact=motion.in_contact & on,
        )

    def _change_hands(self, now_s: float) -> None:
        """Note who has the finger from now on."""
        hand = self._whose(now_s)
        if hand == self._hand:
            return
        if self._hand == "own":
            self._stopped_s = max(now_s, self._lands_s) - self._paused_s
        if self._hand == "client":
            self._pointer.at(np.array([now_s]))  # lifted: it lands anew the next time
        if hand == "own":
            self._paused_s = now_s + LIFT_S - self._stopped_s
        self._hand = hand
        self._lands_s = now_s + LIFT_S

    def _whose(self, now_s: float) -> Hand:
        while self._touches:
            self._taken = self._touches.popleft()
            self._heard_s = now_s
        while self._guidance:
            self._moves = self._guidance.popleft()
            if self._moves or self._hand == "guidance":
                self._guided_s = now_s
        if self._taken and now_s - self._heard_s > SILENT_S:
            self._pointer.push(0.0, 0.0, False, 0.0)
            self._taken = False
        if self._taken:
            return "client"
        over_s = FORGOTTEN_S if self._moves else RESTED_S
        return "guidance" if now_s - self._guided_s <= over_s else "own"
