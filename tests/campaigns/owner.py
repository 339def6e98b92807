"""A client that holds the rig and streams a texture at 5 Hz, as long as it is let."""

import contextlib
from collections.abc import Callable
from typing import Final

import numpy as np

import frictus
from frictus.errors import FrictusError

UPDATE_S: Final = 0.2


def own(endpoint: str, lease_ms: int, pause: Callable[[], object], name: str = "rig1") -> None:
    """Arm and stream for good; again where the lease is lost.

    It resets a rig that tripped: on a machine too busy for it a rig trips by itself.

    Parameters
    ----------
    endpoint : str
    lease_ms : int
    pause : callable
        Waits for `UPDATE_S`; what it raises ends this.
    name : str
        Of the rig.
    """
    wave = 0.08 * np.sin(np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False))
    while True:
        with (
            contextlib.suppress(FrictusError),
            frictus.connect(endpoint, name="owner") as client,
        ):
            rig = client.rig(name)
            if rig.status().state == "tripped":
                rig.reset()
            with rig.arm(lease_ms) as lease, rig.open_stream(0.1) as stream:
                while not lease.lost:
                    stream.send(wave, period_mm=1.0, ttl_ms=1_000)
                    pause()
        pause()
