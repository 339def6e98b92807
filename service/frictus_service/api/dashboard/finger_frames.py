"""Every state of the finger as binary frames, many states in each; `docs/websocket.md`.

JSON would cost ten times the bytes and lose digits of nanoseconds.
"""

from collections.abc import Sequence

import numpy as np

from frictus.messages import FingerState
from frictus.websocket.frames import FINGER_STREAM, FingerFlag, Frame, Kind


class FingerTrace:
    """Makes frames of the states that a viewer has seen; counts those it has not."""

    def __init__(self) -> None:
        self._last: tuple[int, int] | None = None

    def push(
        self, states: Sequence[FingerState], run: int, sample_rate_hz: float
    ) -> list[Frame]:
        """Return one frame of all states; none without a state.

        Parameters
        ----------
        states : sequence of FingerState
            In order.
        run : int
            Of the rig.
        sample_rate_hz : float
            Nominal rate of its device clock.
        """
        if not states:
            return []
        first, last = states[0], states[-1]
        followed = self._last is not None and self._last[0] == run
        expected = self._last[1] + 1 if self._last is not None and followed else first.sequence
        seen, self._last = len(states), (run, last.sequence)
        rows = np.array([_row(state, first.sample) for state in states], dtype=np.float32).T
        return [
            Frame(
                stream=FINGER_STREAM,
                flags=0,
                run=run,
                first_sample=first.sample,
                lost_samples=max(0, last.sequence + 1 - expected - seen),
                sample_rate_hz=sample_rate_hz,
                samples_per_column=1,
                kind=Kind.FINGER,
                utc_ns=first.utc_ns,
                data=rows,
            )
        ]


def _row(state: FingerState, first_sample: int) -> tuple[float, ...]:
    flags = (
        FingerFlag.IN_CONTACT * state.in_contact
        | FingerFlag.STALE * state.stale
        | FingerFlag.EXTRAPOLATED * state.extrapolated
    )
    return (
        state.sample - first_sample,
        state.x_mm,
        state.y_mm,
        state.vx_mm_s,
        state.vy_mm_s,
        state.normal_force_n,
        state.age_ms,
        flags,
    )
