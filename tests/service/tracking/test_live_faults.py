"""What fails on a rig that is served, in real time, is not learned as a finger.

A force sensor at the end of its range is more than 10 N, and the rig stops by itself.
"""

from pathlib import Path

import pytest
from pydantic import TypeAdapter
from tests.service.tracking.served import config_in, first, playing

from frictus_hardware.simulated.faults import Fault

pytestmark = pytest.mark.long

WINDOWS = 40
"""So many are left out for the reason: 2 s of sliding."""
AT_SAMPLE = 40_000
"""When a sensor fails: 2 s are fewer windows than the policy asks for before it adapts."""
_FORCE = {"kind": "sensor", "sensor": "force"}


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("fault", "why"),
    [
        (_FORCE | {"becomes": "dead"}, "no finger presses"),
        (_FORCE | {"becomes": "stuck"}, "the force stands still"),
        (_FORCE | {"becomes": "loose"}, "no finger presses"),  # it rattles about zero
        ({"kind": "touch_stuck"}, "slower than"),
    ],
)
def test_a_sensor_that_fails_is_not_fitted_to(
    tmp_path: Path, fault: dict[str, str], why: str
) -> None:
    faulty: Fault = TypeAdapter(Fault).validate_python(fault | {"at_sample": AT_SAMPLE})
    with playing(config_in(tmp_path, "adapt", faults=(faulty,)), "tracker") as (_, rig):
        begun = rig.model()
        told = first(
            rig,
            lambda told: sum(n for name, n in told.refused.items() if why in name) >= WINDOWS,
        )
        assert told.changes == ()
        assert told.held_back
        assert told.model_etag == begun.etag == rig.model().etag
        assert rig.status().state == "armed"
        assert rig.status().adaptations == 0
