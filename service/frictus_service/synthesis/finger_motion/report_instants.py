"""When touch reports were made, where their stamps scatter.

Positions that are stamped as they arrive are off by milliseconds, of which 1 is 0.1 mm at
100 mm/s, though most sensors report evenly. A delay-locked loop follows the stamps as a line
over the number of the report (Adriaensen 2005, Using a DLL to filter time). It is believed
where places lie nearer to a smooth path by its instants than by the stamps.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import Final

FOLLOWED: Final = 60
"""Reports that make the line: at its end it is a quarter as far off as each stamp."""
LOST: Final = 6
"""After a silence of more reports the line begins anew."""
SHORTEST_S: Final = 1e-4
"""Between reports; those of a burst have one stamp."""
OTHERWISE: Final = 0.4
"""Share by which an interval differs from the line's."""
IN_A_ROW: Final = 3
"""So many such intervals, and the line is wrong."""
SMOOTH: Final = 5
"""Reports, of which a cubic leaves one degree of freedom."""
ROUGH_MM: Final = 1.0
"""What is farther from smooth is no scatter of instants, and counts as so far."""
REMEMBERED: Final = 0.95
"""Share of the squared distances that is kept from report to report."""
NEARER: Final = 0.7
"""Squared distance by even instants over that by stamps, below which even ones are taken; they
are left again where they are farther. Where stamps are exact and even, both are alike."""


class ReportInstants:
    """Tells when each touch report was made."""

    def __init__(self) -> None:
        self._even = False
        self._number = self._otherwise = 0  # reports of the line, and against it in a row
        self._instant_s = self._interval_s = 0.0
        self._by_stamp_mm2 = self._by_even_mm2 = 0.0
        # Stamp, even instant, x and y.
        self._latest: deque[tuple[float, float, float, float]] = deque(maxlen=SMOOTH)

    def lift(self) -> None:
        """Take note that the finger may come down elsewhere."""
        self._latest.clear()

    def instant_s(self, stamp_s: float, place_mm: tuple[float, float]) -> float:
        """Take a report, and return when it was made.

        Parameters
        ----------
        stamp_s : float
            Later than the one before.
        place_mm : tuple of float
            Its x and y.
        """
        even_s = self._follow(stamp_s)
        self._latest.append((stamp_s, even_s, *place_mm))
        if len(self._latest) == SMOOTH:
            self._judge()
        return even_s if self._even else stamp_s

    def _follow(self, stamp_s: float) -> float:
        """Return when a report was made if all are made evenly."""
        since_s = stamp_s - self._instant_s
        known = self._number >= 2
        otherwise = known and abs(since_s - self._interval_s) > OTHERWISE * self._interval_s
        self._otherwise = self._otherwise + 1 if otherwise else 0
        silent = known and since_s > LOST * self._interval_s
        if silent or self._otherwise == IN_A_ROW:
            self._number = self._otherwise = 0
        n = self._number = min(self._number + 1, FOLLOWED)
        if n == 1:
            self._instant_s = stamp_s
        elif n == 2:
            self._instant_s, self._interval_s = stamp_s, max(since_s, SHORTEST_S)
        else:
            steps = max(math.floor(since_s / self._interval_s + 0.25), 1)  # few are lost
            off_s = since_s - steps * self._interval_s
            # Of a straight line by least squares, as long as it becomes longer.
            kept = n * (n + 1.0)
            self._instant_s = stamp_s - off_s * (1.0 - (4.0 * n - 2.0) / kept)
            interval_s = self._interval_s + off_s / steps * 6.0 / kept
            self._interval_s = max(interval_s, SHORTEST_S)
        return self._instant_s

    def _judge(self) -> None:
        stamp_s, even_s, x_mm, y_mm = zip(*self._latest, strict=True)
        by_stamp_mm2 = _roughness_mm2(stamp_s, x_mm, y_mm)
        by_even_mm2 = _roughness_mm2(even_s, x_mm, y_mm)
        self._by_stamp_mm2 = REMEMBERED * self._by_stamp_mm2 + by_stamp_mm2
        self._by_even_mm2 = REMEMBERED * self._by_even_mm2 + by_even_mm2
        least = 1.0 if self._even else NEARER
        self._even = self._by_even_mm2 < least * self._by_stamp_mm2


def _roughness_mm2(
    time_s: Sequence[float], x_mm: Sequence[float], y_mm: Sequence[float]
) -> float:
    """Return the sum of squares that cubics leave of places, at most `ROUGH_MM` squared.

    With one degree of freedom left it is that of a divided difference.
    """
    apart = [
        math.prod(one - other for m, other in enumerate(time_s) if m != n)
        for n, one in enumerate(time_s)
    ]
    if min(map(abs, apart)) < SHORTEST_S ** (SMOOTH - 1):
        return ROUGH_MM**2
    weights = [1.0 / each for each in apart]
    left_mm2 = _sum(weights, x_mm) ** 2 + _sum(weights, y_mm) ** 2
    return min(left_mm2 / _sum(weights, weights), ROUGH_MM**2)


def _sum(weights: Sequence[float], places: Sequence[float]) -> float:
    return sum(weight * place for weight, place in zip(weights, places, strict=True))
