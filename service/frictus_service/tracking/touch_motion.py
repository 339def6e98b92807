"""How the finger moved, from touch reports once they are in: what was rendered was a guess.

A rig renders by a motion that it predicts a lead ahead. In free strokes the predicted speed is
off by 3 mm/s, and by 1 mm/s on the average, since what speeds up or slows down is seen late; a
cutoff that depends on the speed is then off by as much. A report says where the finger was, so
samples wait until reports on both sides of them are there.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from frictus.aligned import AlignedSamples
from frictus.messages import TouchState
from frictus_service.identification.observation.touch_path import AROUND_S, path_among

PATIENCE_S: Final = 1.0
"""Samples for which no reports come meanwhile go on without a motion."""
REPORTS: Final = 2_048
"""Held at most: some seconds of the fastest sensor."""


class TouchedSamples:
    """Gives samples the motion that touch reports tell of them: x, y and speed as ``render``.

    Samples of which no report says how the finger moved get a speed of 0, and are left out of
    windows.
    """

    def __init__(self) -> None:
        self._parts: deque[AlignedSamples] = deque()
        self._reports: deque[TouchState] = deque(maxlen=REPORTS)

    def report(self, report: TouchState) -> None:
        """Take a report.

        Parameters
        ----------
        report : TouchState
            As the rig published it.
        """
        self._reports.append(report)

    def take(self, part: AlignedSamples) -> Iterator[AlignedSamples]:
        """Take samples and yield those, earlier ones too, whose motion is known now.

        Parameters
        ----------
        part : AlignedSamples
            With the stream ``force``.
        """
        self._parts.append(part)
        end = part.first_sample + part.data["force"].shape[1]
        while self._parts:
            oldest = self._parts[0]
            known = self._known_until(oldest)
            waited_s = (end - oldest.first_sample) / part.sample_rate_hz
            if oldest.run == part.run and not known and waited_s < PATIENCE_S:
                return
            yield self._moved(self._parts.popleft())

    def rest(self) -> Iterator[AlignedSamples]:
        """Yield what still waits: no more reports will come."""
        while self._parts:
            yield self._moved(self._parts.popleft())

    def _known_until(self, part: AlignedSamples) -> bool:
        """Return whether reports reach beyond a part."""
        if not self._reports or self._reports[-1].run != part.run:
            return False
        end = part.first_sample + part.data["force"].shape[1]
        return bool(self._reports[-1].sample >= end + AROUND_S * part.sample_rate_hz)

    def _is_past(self, report: TouchState, run: int, sample: float) -> bool:
        if report.run != run:  # their numbers tell no order
            return self._reports[-1].run == run
        return report.sample < sample

    def _moved(self, part: AlignedSamples) -> AlignedSamples:
        around = AROUND_S * part.sample_rate_hz
        first, n_samples = part.first_sample, part.data["force"].shape[1]
        while self._reports and self._is_past(self._reports[0], part.run, first - around):
            self._reports.popleft()
        near = [
            (report.x_mm, report.y_mm, report.sample / part.sample_rate_hz)
            for report in self._reports
            if report.run == part.run
            and report.in_contact
            and first - around <= report.sample <= first + n_samples + around
        ]
        time_s = (first + np.arange(n_samples)) / part.sample_rate_hz
        reports = np.array(near, dtype=float).reshape(-1, 3)
        motion = path_among(reports[:, :2], reports[:, 2], time_s).astype(np.float32)
        return replace(part, data={**part.data, "render": motion})
