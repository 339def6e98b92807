"""What a disarmed simulated rig publishes of its state."""

import time
from typing import Any

from frictus.messages import RigStatus


def rig_status(**changes: Any) -> RigStatus:
    """Return the status of such a rig, but for some fields."""
    said: dict[str, Any] = {
        "site": "lab",
        "rig": "rig1",
        "version": "0.1.0",
        "run": 1,
        "utc_ns": time.time_ns(),
        "state": "disarmed",
        "backend": "simulated",
        "simulated": True,
        "finger_source": "simulated",
        "sample_rate_hz": 20_000.0,
        "block_samples": 100,
        "lead_ms": 20.0,
        "screen_mm": (100.0, 60.0),
        "screen_peak_v": 75.0,
        "model_etag": "m0",
        "model_placeholder": False,
        "scene_etag": "s0",
    }
    return RigStatus(**(said | changes))
