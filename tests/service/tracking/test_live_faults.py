"""What fails on a rig that is served, in real time, is not learned as a finger."""

import struct
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import TypeAdapter
from tests.campaigns.starts import CLOCK, COMPILER
from tests.service.tracking.served import PERSON, config_in, first, follows, playing

from frictus_hardware.simulated.faults import Fault

pytestmark = pytest.mark.long

WINDOWS = 40
"""So many are left out for the reason: 2 s of sliding."""
AT_SAMPLE = 40_000
"""When a sensor fails: 2 s are fewer windows than the policy asks for before it adapts."""
_FORCE = {"kind": "sensor", "sensor": "force"}
STEP_S = 3
"""As a time server steps a clock; a lease of 10 s outlives it."""


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("fault", "why"),
    [
        (_FORCE | {"becomes": "dead"}, "no finger presses"),
        (_FORCE | {"becomes": "stuck"}, "the force stands still"),
        (_FORCE | {"becomes": "saturated"}, "the force stands still"),
        (_FORCE | {"becomes": "loose"}, "friction does not follow the drive"),
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


@pytest.mark.skipif(
    sys.platform != "linux" or COMPILER is None, reason="the clock is stepped by a preload"
)
@pytest.mark.timeout(300)
@pytest.mark.parametrize("step_s", [STEP_S, -STEP_S])
def test_a_step_of_the_clock_is_not_felt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step_s: int
) -> None:
    assert COMPILER is not None
    library, file = tmp_path / "clock.so", tmp_path / "step"
    subprocess.run([COMPILER, "-shared", "-fPIC", "-o", library, CLOCK], check=True)
    file.write_bytes(bytes(8))
    monkeypatch.setenv("LD_PRELOAD", str(library))
    monkeypatch.setenv("CLOCK_STEP_FILE", str(file))
    with playing(config_in(tmp_path, "adapt"), "tracker") as (_, rig):
        before = first(rig, follows)
        file.write_bytes(struct.pack("=q", step_s))
        after = first(rig, lambda told: told.windows > before.windows + WINDOWS)
        assert abs(after.utc_ns - before.utc_ns) > 0
        assert after.run == before.run
        assert after.new_fingers == before.new_fingers
        assert after.alarms == ()
        assert after.law is not None
        assert after.law.gain_n.value == pytest.approx(PERSON.gain_n, rel=0.05)
        assert after.error_db["in_force"] < 0.3
        assert rig.status().state == "armed"
