"""The response in points, and what is not told as one."""

import numpy as np
from tests.service.tracking.slides import BANDS, PAPER, slide, speeds

from frictus.messages import ResponsePoint
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.measured_points import MeasuredPoints


def points(rng: np.random.Generator, times: float) -> tuple[ResponsePoint, ...]:
    """Return the points of forces that are so many times a finger's."""
    law = PAPER + np.array([0.0, 0.0, np.log(times), 0.0])
    found = MeasuredPoints.begin(BANDS.centre_hz.size)
    for _ in range(20):
        found = found.seen(Batch.of(slide(rng, law, speeds(rng)), BANDS))
    return found.points(BANDS.centre_hz, BANDS.lines)


def test_forces_that_no_finger_makes_are_not_told(rng: np.random.Generator) -> None:
    assert points(rng, 1.0) != ()
    assert points(rng, 1e7) == ()
