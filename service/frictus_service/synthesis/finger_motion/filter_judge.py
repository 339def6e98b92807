"""Which filter predicts the finger better: that of touch alone, or that of all sensors."""

from collections import deque
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray

JUDGED_S: Final = 0.4
"""Within which the predictions of both filters are judged."""
ALIKE_MM: Final = 0.05
"""Errors of predictions that differ by less are alike."""
WORSE: Final = 1.5
"""Mean square error over that of touch alone from which on touch alone is rendered."""
PREDICTIONS: Final = 512
"""Kept until the reports of their time come."""


class FilterJudge:
    """Compares what both filters predicted with the reports of that time.

    Attributes
    ----------
    better : bool
        Whether the filter of all sensors predicts at least as well as that of touch alone.
    """

    def __init__(self) -> None:
        # (time; x and y by touch alone; x and y by all), one a block.
        self._predicted: deque[tuple[float, ...]] = deque(maxlen=PREDICTIONS)
        self._reported_s = -np.inf
        self._error_mm2 = [0.0, 0.0]
        self.better = True

    def restart(self) -> None:
        """Forget what was predicted: the finger is elsewhere."""
        self._predicted.clear()

    def predict(self, time_s: float, touch: FloatArray, fused: FloatArray) -> None:
        """Keep both predictions for a time."""
        self._predicted.append((time_s, touch[0, 0], touch[1, 0], fused[0, 0], fused[1, 0]))

    def report(self, time_s: float, x_mm: float, y_mm: float) -> None:
        """Judge by where the finger was."""
        kept = self._predicted
        while len(kept) > 1 and kept[1][0] <= time_s:
            kept.popleft()
        if len(kept) < 2 or kept[0][0] > time_s:
            return
        before, after = kept[0], kept[1]
        share = (time_s - before[0]) / (after[0] - before[0])
        forget = min((time_s - self._reported_s) / JUDGED_S, 1.0)
        self._reported_s = time_s
        for which in range(2):
            squared = 0.0
            for column, true_mm in ((1 + 2 * which, x_mm), (2 + 2 * which, y_mm)):
                predicted = before[column] + share * (after[column] - before[column])
                squared += (predicted - true_mm) ** 2
            self._error_mm2[which] += forget * (squared - self._error_mm2[which])
        touch, fused = self._error_mm2
        if self.better:
            self.better = fused < WORSE * touch + ALIKE_MM**2
        else:
            self.better = fused < touch
