"""Virtual fingers that follow: points sent by a client, or guidance as a participant does."""

import math
from collections import deque
from typing import Final, Literal, NamedTuple

import numpy as np
from pydantic import Field

from frictus_hardware.arguments import LEAST_N, NonNegative, StrictModel
from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.motion import FingerMotion, Wander


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


FASTEST_MM_S: Final = 200.0
REST_N: Final = 0.4
EDGE_MM: Final = 2.0
"""Kept free at both ends of the screen, whatever the guidance asks for."""
SLOWEST_MM_S: Final = 1e-3
"""Slower is no motion; where half of a speed is none, its strokes would last for no time."""
LEAST_SHARE: Final = 0.2
"""Of the speed asked for: no error makes a stroke slower."""


class GuidedStrokes(StrictModel):
    """Strokes along x at the speed and force that guidance asks for, with a person's errors.

    Until guidance comes, and whenever it asks for no speed, the finger rests on the screen.

    Attributes
    ----------
    reaction_s : float
        From a change of the guidance to its being acted on.
    change_s : float
        How long a change of speed or force takes then; it follows half a cosine.
    turn_s : float
        How long a turn at the end of a stroke takes.
    speed_error : float
        Standard deviation of a stroke's speed, as a share of what was asked for.
    force_error : float
        Standard deviation of the force as a share of what was asked for, between 0.1 and 2 Hz.
    """

    kind: Literal["guided"] = "guided"
    reaction_s: float = Field(default=0.25, ge=0.0, le=5.0)
    change_s: float = Field(default=0.3, gt=0.0, le=5.0)
    turn_s: float = Field(default=0.08, gt=0.0, le=1.0)
    speed_error: NonNegative = 0.03
    force_error: NonNegative = 0.06

    def start(self, screen_mm: tuple[float, float], rng: np.random.Generator) -> "GuidedFinger":
        """Return the finger, at rest in the middle of the screen.

        Raises
        ------
        ConfigError
            If the screen is too narrow to stroke on.
        """
        if not screen_mm[0] > 4.0 * EDGE_MM:
            raise ConfigError(
                f"a screen {screen_mm[0]} mm wide: a guided finger needs more than "
                f"{4.0 * EDGE_MM:g} mm"
            )
        return GuidedFinger(self, screen_mm, rng)


class Ramp(NamedTuple):
    """A level that goes over to another along half a cosine, and what it sums up to.

    Attributes
    ----------
    begin_s, duration_s : float
        An infinite one holds the level that it starts with, which must be 0.
    before, after : float
        The level at the beginning and at the end.
    start : float
        The sum at the beginning.
    """

    begin_s: float
    duration_s: float
    before: float
    after: float
    start: float = 0.0

    @property
    def end_s(self) -> float:
        """When it is over."""
        return self.begin_s + self.duration_s

    def level(self, time_s: FloatArray) -> FloatArray:
        """Return the level at times from the beginning on."""
        share = np.minimum((time_s - self.begin_s) / self.duration_s, 1.0)
        level: FloatArray = self.before + (self.after - self.before) * 0.5 * (
            1.0 - np.cos(np.pi * share)
        )
        return level

    def sum(self, time_s: FloatArray) -> FloatArray:
        """Return the sum at times from the beginning to the end."""
        if math.isinf(self.duration_s):
            return np.full_like(time_s, self.start)
        since = time_s - self.begin_s
        bend = self.duration_s / np.pi * np.sin(np.pi * since / self.duration_s)
        change = 0.5 * (self.after - self.before)
        return self.start + self.before * since + change * (since - bend)


class Wish(NamedTuple):
    """What guidance asks for."""

    speed_mm_s: float
    force_n: float
    span_mm: tuple[float, float]


class GuidedFinger:
    """See `GuidedStrokes`.

    `push` may be called from any thread; `at` from one, with times that only increase.
    """

    def __init__(
        self,
        settings: GuidedStrokes,
        screen_mm: tuple[float, float],
        rng: np.random.Generator,
    ) -> None:
        self._settings = settings
        self._screen_mm = screen_mm
        self._rng = rng
        self._tremble = Wander.draw(rng, (0.1, 2.0), settings.force_error)
        middle = screen_mm[0] / 2.0
        self._wish = Wish(0.0, REST_N, (EDGE_MM, screen_mm[0] - EDGE_MM))
        self._pushed = self._wish
        self._coming: deque[tuple[float, Wish]] = deque(maxlen=64)
        self._now_s = 0.0
        self._path = Ramp(0.0, math.inf, 0.0, 0.0, middle)
        self._force = Ramp(0.0, 1.0, REST_N, REST_N)
        self._under_way = False

    def push(self, speed_mm_s: float, force_n: float, span_mm: tuple[float, float]) -> None:
        """Set what the finger shall do, from one reaction time on.

        Parameters
        ----------
        speed_mm_s : float
            Of the strokes, 0 to 200; below `SLOWEST_MM_S`: rest on the screen.
        force_n : float
            0.05 to 5.
        span_mm : tuple of float
            Ends of the strokes along x; taken to the nearest places on the screen.

        Raises
        ------
        ConfigError
            If a number is not finite or out of its range.
        """
        low, high = span_mm
        fit = (
            0.0 <= speed_mm_s <= FASTEST_MM_S
            and LEAST_N <= force_n <= 5.0
            and -math.inf < low < high < math.inf
        )
        if not fit:
            raise ConfigError(
                f"guidance to {speed_mm_s} mm/s and {force_n} N from {low} to {high} mm: "
                f"0 to {FASTEST_MM_S:g} mm/s, {LEAST_N:g} to 5 N, and ends in order accepted"
            )
        width = self._screen_mm[0]
        low = min(max(low, EDGE_MM), width / 2.0 - EDGE_MM)
        high = max(min(high, width - EDGE_MM), width / 2.0 + EDGE_MM)
        moves = speed_mm_s >= SLOWEST_MM_S
        wish = Wish(speed_mm_s if moves else 0.0, force_n, (low, high))
        if wish != self._pushed:
            self._pushed = wish
            self._coming.append((self._now_s + self._settings.reaction_s, wish))

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at given times, none before the last ones asked for."""
        time_s = np.asarray(time_s, dtype=np.float64)
        x = np.empty(time_s.size)
        rate = np.empty(time_s.size)
        force = np.empty(time_s.size)
        done = 0
        while done < time_s.size:
            path = self._path
            due_s = self._coming[0][0] if self._coming else math.inf
            # What came due in a past that has been told already holds from now on.
            end_s = min(path.end_s, max(due_s, self._now_s, path.begin_s))
            upto = max(int(np.searchsorted(time_s, end_s)), done)
            part = time_s[done:upto]
            x[done:upto], rate[done:upto] = path.sum(part), path.level(part)
            force[done:upto] = self._force.level(part)
            if upto < time_s.size:
                self._go_on(end_s, due=due_s <= end_s)
            done = upto
        if time_s.size:
            self._now_s = float(time_s[-1])
        pressed = np.maximum(force * (1.0 + self._tremble.value(time_s)), LEAST_N)
        position = np.column_stack([x, np.full(x.size, self._screen_mm[1] / 2.0)])
        velocity = np.column_stack([rate, np.zeros(x.size)])
        return FingerMotion(position, velocity, pressed, np.ones(x.size, dtype=np.bool_))

    def _go_on(self, now_s: float, due: bool) -> None:
        """Plan what follows: a wish has come due, or the present piece of path is over."""
        now = np.array([now_s])
        if due:
            _, self._wish = self._coming.popleft()
            held = float(self._force.level(now)[0])
            self._force = Ramp(now_s, self._settings.change_s, held, self._wish.force_n)
            self._under_way = False
        x, v = float(self._path.sum(now)[0]), float(self._path.level(now)[0])
        self._path = self._planned(now_s, x, v)

    def _planned(self, now_s: float, x: float, v: float) -> Ramp:
        """Return the next piece of path: to change speed, to go on, to turn, or to rest."""
        low, high = self._wish.span_mm
        turn_s = self._settings.turn_s
        ahead = math.copysign(1.0, v if v != 0.0 else 0.5 * (low + high) - x)
        room = high - x if ahead > 0.0 else x - low
        if self._under_way and self._wish.speed_mm_s > 0.0:
            # Nothing goes further during a turn than at its first speed for half of it.
            way = room - 0.5 * abs(v) * turn_s
            if way > 1e-6:
                return Ramp(now_s, way / abs(v), v, v, x)
            return Ramp(now_s, turn_s, v, -ahead * self._drawn(), x)
        self._under_way = True
        speed = self._drawn()
        if speed == v == 0.0:
            return Ramp(now_s, math.inf, 0.0, 0.0, x)
        way = room - 0.5 * speed * turn_s
        change_s = min(self._settings.change_s, 2.0 * way / (abs(v) + speed))
        if speed > 0.0 and change_s < turn_s:
            return Ramp(now_s, turn_s, v, -ahead * speed, x)
        return Ramp(now_s, max(change_s, 1e-3), v, ahead * speed, x)

    def _drawn(self) -> float:
        """Return the speed of a stroke, with its error."""
        error = self._settings.speed_error * float(self._rng.standard_normal())
        return self._wish.speed_mm_s * max(1.0 + error, LEAST_SHARE)
