"""A finger that scatters as people do raises no alarm; causes are found all the same."""

import numpy as np
import pytest
from scipy.stats import binom
from tests.service.tracking.scattered import watched

from frictus_hardware.physics.schedule import SlidingConditions
from frictus_service.tracking.estimation.strokes import Strokes
from frictus_service.tracking.evidence.naming import named_alarms
from frictus_service.tracking.evidence.watch import LEVEL

pytestmark = pytest.mark.long

SEED = 20260
SESSIONS = 200
BATCHES = 8
"""Of a session: 4 s of sliding."""


def test_a_finger_that_scatters_as_people_do_hardly_ever_raises_an_alarm() -> None:
    ever = [
        watched(np.random.default_rng((SEED, number)), BATCHES, np.zeros(4)).first is not None
        for number in range(SESSIONS)
    ]
    assert sum(ever) <= binom.ppf(0.99, SESSIONS, LEVEL)


def test_windows_of_a_stroke_are_told_by_direction_and_time() -> None:
    direction = np.array([1.0, 1.0, -1.0, -1.0, -1.0])
    seconds = np.array([0.0, 0.05, 0.2, 0.25, 1.0])
    same = np.ones(5)
    around = SlidingConditions(same, same, same, direction, seconds / 60.0)
    strokes = Strokes.of(around, 1.0, -0.05 / 60.0)
    assert strokes.part.tolist() == [0, 0, 1, 1, 2]
    assert strokes.begins.tolist() == [False, True, True]
    assert Strokes.of(around, -1.0, -0.05 / 60.0).begins.tolist() == [True, True, True]
    assert Strokes.of(around, -1.0, -0.05 / 60.0).part.tolist() == [0, 0, 1, 1, 2]


@pytest.mark.parametrize(
    ("off", "asymmetry", "cause", "within"),
    [
        ((0.0, 0.0, np.log(1.5), 0.0), 0.0, "gain", 60),
        ((np.log(2.0), np.log(2.0), 0.0, 0.0), 0.0, "cutoff", 4),
        ((0.0, 0.0, 0.0, 100e-6), 0.0, "delay", 4),
        ((0.0, 0.0, 0.0, 0.0), 0.06, "direction_asymmetry", 24),
    ],
)
def test_what_is_wrong_is_named_although_the_finger_scatters(
    off: tuple[float, ...], asymmetry: float, cause: str, within: int
) -> None:
    """Within so many batches of half a second of sliding."""
    for number in range(3):
        rng = np.random.default_rng((SEED, number))
        found = watched(rng, within, np.array(off), asymmetry)
        assert [alarm.cause for alarm in named_alarms(found.watch)] == [cause]
