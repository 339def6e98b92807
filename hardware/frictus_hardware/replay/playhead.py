"""Where on a tape the next block lies, and which touch reports come next."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.base import TouchReport
from frictus_hardware.replay.tape import Tape

SEAM_SAMPLES: Final = 1
"""Between the end of a tape and its next beginning, so that none takes them for neighbours."""


@dataclass(frozen=True, slots=True)
class Cut:
    """A block of a tape.

    Attributes
    ----------
    row : int
        Its first sample among those stored.
    first_sample : int
        The same on the device, laps counted.
    """

    row: int
    first_sample: int


class Playhead:
    """Walks through a tape, block by block; a block never spans a gap.

    Parameters
    ----------
    tape : Tape
        What was recorded.
    loops : bool
        Whether it begins again at the end.
    """

    def __init__(self, tape: Tape, loops: bool) -> None:
        ends = np.append(tape.stretch_row[1:], tape.voltage_v.size)
        self._rows = list(zip(tape.stretch_row.tolist(), ends.tolist(), strict=True))
        self._firsts: list[int] = tape.stretch_first_sample.tolist()
        self._lap_samples = lap_samples(tape)
        self._loops = loops
        self._stretch = 0
        self._row = 0
        self._lap = 0

    def take(self, n_samples: int) -> Cut | None:
        """Return the next block, or None at the end.

        What is left before a gap and fills no block is passed over.

        Parameters
        ----------
        n_samples : int
            At most `longest_stretch` of the tape.
        """
        while self._rows[self._stretch][1] - self._row < n_samples:
            if not self._go_on():
                return None
        begin = self._rows[self._stretch][0]
        first = self._firsts[self._stretch] + self._row - begin
        cut = Cut(self._row, first + self._lap * self._lap_samples)
        self._row += n_samples
        return cut

    def _go_on(self) -> bool:
        last = self._stretch + 1 == len(self._rows)
        if last and not self._loops:
            return False
        self._lap += last
        self._stretch = 0 if last else self._stretch + 1
        self._row = self._rows[self._stretch][0]
        return True


def lap_samples(tape: Tape) -> int:
    """Return by how many device samples one lap is later than the one before."""
    return tape.end_sample - tape.first_sample + SEAM_SAMPLES


def longest_stretch(tape: Tape) -> int:
    """Return the length of the longest stretch without a gap, samples."""
    return int(np.diff(tape.stretch_row, append=tape.voltage_v.size).max())


def touches_of(tape: Tape, loops: bool) -> Iterator[tuple[int, TouchReport]]:
    """Yield the touch reports, each with the device sample during which it arrives."""
    shift = 0
    while tape.touch_arrival_sample.size:
        for row, arrival in enumerate(tape.touch_arrival_sample):
            report = TouchReport(
                measured_sample=float(tape.touch_measured_sample[row]) + shift,
                x_mm=float(tape.touch_x_mm[row]),
                y_mm=float(tape.touch_y_mm[row]),
                in_contact=bool(tape.touch_in_contact[row]),
            )
            yield int(arrival) + shift, report
        if not loops:
            return
        shift += lap_samples(tape)
