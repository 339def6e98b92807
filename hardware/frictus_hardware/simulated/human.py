"""A virtual finger that explores as people do."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from frictus_hardware.arguments import NonNegative, Positive, StrictModel
from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.motion import FingerMotion, NormalForce, Press, Wander

LOOP_S = 600.0
"""The strokes repeat after (a little more than) this, so that memory does not grow."""

STROKE_MM = (20.0, 60.0)
SPEED_MM_S = (25.0, 110.0)
SPEED_LOG_SD = 0.2
SPEED_PER_LENGTH = 0.6
"""Longer strokes are faster: speed grows with this power of the length (isochrony; Viviani and
Terzuolo 1982)."""
MIDDLE_MM = 40.0
PAUSE_PROBABILITY = 0.25
PAUSE_S = (0.05, 0.3)
LIFT_S = (0.12, 0.3)
TREMOR_HZ = (8.0, 12.0)
DRIFT_HZ = (0.05, 0.2)
EDGE_MM = 2.0
"""Kept free along each edge for the tremor."""


class HumanStrokes(StrictModel):
    """Strokes of random length back and forth, 20 to 60 mm, as people rub a surface.

    Each stroke has least jerk between its ends (Flash and Hogan 1985). At most turns the finger
    does not stop but swings round, as in any rhythmic movement (Guiard 1993): its acceleration
    there is that of a sinusoid. At one turn in four it rests for 0.05 to 0.3 s. Mean speeds of
    the strokes are lognormal, between 25 and 110 mm/s, and grow with the length. The finger
    drifts slowly along y and trembles at 8 to 12 Hz.

    Attributes
    ----------
    median_speed_mm_s : float
        Median of the mean speeds of strokes of 40 mm.
    drift_mm : float
        Standard deviation of the drift along y.
    tremor_mm : float
        Standard deviation of the tremor, each along x and y; at most 0.2.
    lift_probability : float
        How often the finger leaves the screen between two strokes.
    press : Press
        How hard it presses.
    """

    kind: Literal["human"] = "human"
    median_speed_mm_s: Positive = 60.0
    drift_mm: NonNegative = 2.0
    tremor_mm: float = Field(default=0.02, ge=0.0, le=0.2)
    lift_probability: float = Field(default=0.0, ge=0.0, le=1.0)
    press: Press = Press()

    def start(self, screen_mm: tuple[float, float], rng: np.random.Generator) -> "HumanFinger":
        """Return the finger.

        Raises
        ------
        ConfigError
            If the screen is too small for strokes of 20 mm there and back.
        """
        room_mm = screen_mm[0] - 2.0 * EDGE_MM
        if not room_mm >= 2.0 * STROKE_MM[0]:
            raise ConfigError(
                f"a screen {screen_mm[0]} mm wide: human strokes need at least "
                f"{2.0 * STROKE_MM[0] + 2.0 * EDGE_MM} mm"
            )
        middle = screen_mm[1] / 2.0
        drift = Wander.draw(rng, DRIFT_HZ, self.drift_mm)
        fit = min(1.0, (middle - EDGE_MM) / max(drift.bound, 1e-9))
        return HumanFinger(
            draw_strokes(self, room_mm, rng),
            tremor_x=Wander.draw(rng, TREMOR_HZ, self.tremor_mm),
            tremor_y=Wander.draw(rng, TREMOR_HZ, self.tremor_mm),
            drift=Wander(drift.frequency_hz, drift.phase_rad, drift.amplitude * max(fit, 0.0)),
            middle_mm=middle,
            force=self.press.start(rng),
        )


@dataclass(frozen=True, slots=True)
class DrawnStrokes:
    """A loop of strokes, each followed by a rest; arrays of shape (n_strokes,).

    Attributes
    ----------
    begin_s, move_s : ndarray
        When a stroke begins, and how long it takes; the rest lasts until the next begins.
    from_mm, to_mm : ndarray
        Ends of each stroke along x.
    lift : ndarray of bool
        Whether the finger leaves the screen during the rest.
    turn_mm_s2 : ndarray, shape (n_strokes, 2)
        Acceleration at the beginning and at the end of a stroke.
    loop_s : float
        Length of the loop.
    """

    begin_s: FloatArray
    move_s: FloatArray
    from_mm: FloatArray
    to_mm: FloatArray
    lift: NDArray[np.bool_]
    turn_mm_s2: FloatArray
    loop_s: float


def draw_strokes(
    settings: HumanStrokes, room_mm: float, rng: np.random.Generator
) -> DrawnStrokes:
    """Return a loop of strokes that ends where it began.

    Parameters
    ----------
    settings : HumanStrokes
        Ranges that strokes are drawn from.
    room_mm : float
        Width to move in, from `EDGE_MM` on.
    rng : Generator
        Source of everything random.
    """
    shortest, longest = STROKE_MM
    home = EDGE_MM + 0.1 * (room_mm - 2.0 * shortest)
    ends, moves, rests, lifts = [home], [], [], []
    clock_s = 0.0
    while True:
        rightward = len(ends) % 2 == 1
        room = EDGE_MM + room_mm - ends[-1] if rightward else ends[-1] - EDGE_MM
        length = rng.uniform(shortest, min(longest, room))
        back = ends[-1] - home
        last = not rightward and clock_s > LOOP_S and shortest <= back <= longest
        length = back if last else length
        speed = settings.median_speed_mm_s * math.exp(SPEED_LOG_SD * rng.standard_normal())
        speed *= (length / MIDDLE_MM) ** SPEED_PER_LENGTH
        lift = bool(rng.random() < settings.lift_probability)
        pause = bool(rng.random() < PAUSE_PROBABILITY)
        moves.append(length / min(max(speed, SPEED_MM_S[0]), SPEED_MM_S[1]))
        rests.append(rng.uniform(*(LIFT_S if lift else PAUSE_S)) if lift or pause else 0.0)
        lifts.append(lift)
        ends.append(ends[-1] + (length if rightward else -length))
        clock_s += moves[-1] + rests[-1]
        if last:
            break
    took = np.add(moves, rests)
    return DrawnStrokes(
        begin_s=np.concatenate([[0.0], np.cumsum(took)[:-1]]),
        move_s=np.array(moves),
        from_mm=np.array(ends[:-1]),
        to_mm=np.array(ends[1:]),
        lift=np.array(lifts),
        turn_mm_s2=_turns(np.diff(ends), np.array(moves), np.array(rests) == 0.0),
        loop_s=float(np.sum(took)),
    )


def _turns(length_mm: FloatArray, move_s: FloatArray, swings: NDArray[np.bool_]) -> FloatArray:
    """Return the acceleration at both ends of each stroke, 0 where the finger rests."""
    own = np.pi**2 / 2.0 * length_mm / np.square(move_s)  # of a sinusoid at its turn
    after = np.where(swings, 0.5 * (np.roll(own, -1) - own), 0.0)
    return np.column_stack([np.roll(after, 1), after])


@dataclass(frozen=True, slots=True)
class HumanFinger:
    """See `HumanStrokes`."""

    strokes: DrawnStrokes
    tremor_x: Wander
    tremor_y: Wander
    drift: Wander
    middle_mm: float
    force: NormalForce

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at given times."""
        # Late, because a process that only reads a configuration needs no compiler.
        from frictus_hardware.simulated.kernels import explore

        time_s = np.ascontiguousarray(time_s, dtype=np.float64)
        strokes = self.strokes
        motion = FingerMotion(
            np.empty((time_s.size, 2)),
            np.empty((time_s.size, 2)),
            np.empty(time_s.size),
            np.empty(time_s.size, np.bool_),
        )
        explore(
            time_s,
            strokes.begin_s,
            strokes.move_s,
            strokes.from_mm,
            strokes.to_mm,
            strokes.lift,
            strokes.turn_mm_s2,
            strokes.loop_s,
            self.tremor_x.table,
            self.tremor_y.table,
            self.drift.table,
            self.force.wander.table,
            self.middle_mm,
            self.force.target_n,
            motion.position_mm,
            motion.velocity_mm_s,
            motion.normal_force_n,
            motion.in_contact,
        )
        return motion
