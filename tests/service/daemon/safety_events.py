"""What may happen to a rig, as its safety is searched."""

from typing import Final

import numpy as np

from frictus_service.daemon.block_loop.loop import LOST
from frictus_service.daemon.safety import Arm, ClientVanished, Disarm, Event, Renew, Reset, Stop

CLIENTS: Final[dict[str, Event]] = {
    "arm ann": Arm("ann", 0.0),  # for `LEASE_BLOCKS`
    "arm ben": Arm("ben", 0.0),
    "arm ann, keep model": Arm("ann", 0.0, keep_model=True),
    "renew ann": Renew("ann"),
    "disarm ann": Disarm("ann"),
    "disarm ben": Disarm("ben"),
    "stop": Stop("anyone"),
    "ann vanished": ClientVanished("ann"),
    "ben vanished": ClientVanished("ben"),
    "reset": Reset(),
}
MEANWHILE: Final = ", meanwhile"
"""Of an event that comes when the loop has decided on a block and waits for its end."""
SENSED: Final = {
    "force limit": {"force_n": 11.0},
    "force not a number": {"force_n": np.nan},
    "monitor mismatch": {"monitor": 0.5},
    "monitor not a number": {"monitor": np.nan},
    "underrun": {},
    "overrun": {},
    "deadline": {},
    "loop exception": {},
}
TRIPPING: Final = (*list(SENSED)[:4], "deadline", "loop exception", "safety", *LOST[:2])
FINGER: Final = ("finger lifted", "finger silent", "finger back")
HEALTH: Final = ("sensor lost", "sensor back")
ADAPT: Final = "adapt"
"""A tracker's model is under way."""
EVENTS: Final = (
    "nothing",
    ADAPT,
    *CLIENTS,
    *(name + MEANWHILE for name in CLIENTS),
    *SENSED,
    *FINGER,
    *HEALTH,
    "sensor",
    "safety",
    *LOST,
)
GROUPS: Final = {
    "owner": (
        "nothing",
        "arm ann",
        "arm ben",
        "renew ann",
        "disarm ann",
        "stop, meanwhile",
        "force limit",
        "reset",
    ),
    "finger": (
        "nothing",
        "arm ann",
        "ann vanished, meanwhile",
        "finger silent",
        "finger back",
        "sensor",
    ),
    "model": (
        "nothing",
        "arm ann",
        "arm ann, keep model",
        "arm ann, keep model, meanwhile",
        "stop, meanwhile",
        "finger silent",
        "finger back",
        ADAPT,
    ),
    "lift": ("nothing", "arm ann", "finger lifted", "finger back", *HEALTH),
    "output": (
        "nothing",
        "arm ann",
        "stop",
        "underrun",
        "overrun",
        "monitor mismatch",
        "reset",
    ),
    "device": (
        "nothing",
        "arm ann",
        *LOST,
        "safety",
        "loop exception",
        "deadline",
        "monitor not a number",
        "reset",
    ),
}
"""Events whose every order is searched; all together have more orders than a test has time."""
