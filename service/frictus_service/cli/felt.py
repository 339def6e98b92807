"""What the finger feels and how the rig fares, gathered from everything the rig publishes."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from frictus import Block, Feed, FingerState, Gap, Rig, RigStatus, SceneState, Topics
from frictus.errors import SilenceError
from frictus.rig import StreamName
from frictus.textures import BAND_HZ

T = TypeVar("T")

STREAMS: Final[tuple[StreamName, ...]] = ("force", "accel", "voltage", "truth")
WINDOW_S: Final = 0.25
FRICTION_ROW: Final = {"truth": 4, "force": 0}
"""Where friction stands: simulated rigs tell it; else the lateral force of the sensor."""


@dataclass(frozen=True, slots=True)
class RigSnapshot:
    """One look at a rig.

    Attributes
    ----------
    finger : FingerState or None
        The newest; None before the first.
    status : RigStatus or None
        The newest; None where the rig has told none yet.
    scene : SceneState or None
        The active one, with what was applied.
    friction_rms_n : float or None
        Friction felt, 20 to 1000 Hz, over the last quarter of a second, N rms.
    friction_from : str or None
        `truth`, of a simulated rig, or `force`, from the sensor, mount included.
    received, lost : dict of str to int
        Blocks per stream since the observer was made.
    gaps : dict of str to int
        Gaps by reason, over all streams.
    silent_s : float
        Since a finger state or block came from the rig.
    """

    finger: FingerState | None
    status: RigStatus | None
    scene: SceneState | None
    friction_rms_n: float | None
    friction_from: str | None
    received: dict[str, int]
    lost: dict[str, int]
    gaps: dict[str, int]
    silent_s: float

    def fields(self) -> dict[str, Any]:
        """Return it as what a JSON line holds."""
        status = self.status
        return {
            "finger": self.finger and self.finger.model_dump(),
            "friction_rms_n": self.friction_rms_n,
            "friction_from": self.friction_from,
            "applied_gain": self.scene.applied.gain if self.scene else None,
            "state": status and status.state,
            "owner": status and status.owner,
            "fault": status.fault.reason if status and status.fault else None,
            "counters": status and status.counters.model_dump(),
            "timing": status and status.timing.model_dump(),
            "blocks_received": self.received,
            "blocks_lost": self.lost,
            "gaps": self.gaps,
            "silent_s": round(self.silent_s, 3),
        }


class Observer:
    """Gathers what a rig publishes; look at it several times per second.

    Parameters
    ----------
    rig : Rig
        The rig.
    clock_s : callable
        Monotonic time.
    """

    def __init__(self, rig: Rig, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._fingers = rig.fingers(timeout_s=0.0)
        self._statuses = rig.watch(Topics.STATUS, timeout_s=0.0)
        self._scenes = rig.watch(Topics.SCENE, timeout_s=0.0)
        self._blocks = {name: rig.blocks(name, timeout_s=0.0) for name in STREAMS}
        self._recent: dict[str, list[Block]] = {name: [] for name in FRICTION_ROW}
        self._gaps: Counter[str] = Counter()
        self._finger: FingerState | None = None
        self._status: RigStatus | None = None
        self._scene: SceneState | None = None
        self._heard_s = clock_s()

    def look(self) -> RigSnapshot:
        """Take what has come since the last look; never waits for more."""
        for finger in self._fingers.drain():
            self._finger = finger
            self._heard_s = self._clock_s()
        for status in _waiting(self._statuses):
            self._status = status if isinstance(status, RigStatus) else self._status
        for scene in _waiting(self._scenes):
            self._scene = scene if isinstance(scene, SceneState) else self._scene
        for name, feed in self._blocks.items():
            for item in _waiting(feed):
                self._take(name, item)
        source = next((name for name in FRICTION_ROW if self._recent[name]), None)
        return RigSnapshot(
            self._finger,
            self._status,
            self._scene,
            _friction_rms_n(self._recent[source], FRICTION_ROW[source]) if source else None,
            source,
            {name: feed.received for name, feed in self._blocks.items()},
            {name: feed.lost for name, feed in self._blocks.items()},
            dict(self._gaps),
            self._clock_s() - self._heard_s,
        )

    def _take(self, name: str, item: Block | Gap) -> None:
        self._heard_s = self._clock_s()
        if isinstance(item, Gap):
            self._gaps[item.reason] += 1
        if name not in self._recent:
            return
        if isinstance(item, Gap):
            self._recent[name].clear()  # a spectrum over a gap would be wrong
            return
        recent = self._recent[name]
        recent.append(item)
        while sum(b.data.shape[1] for b in recent[1:]) >= WINDOW_S * item.sample_rate_hz:
            recent.pop(0)


def band_rms(samples: NDArray[np.floating[Any]], sample_rate_hz: float) -> float | None:
    """Return the root mean square between 20 and 1000 Hz.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        At least 0.1 s of a signal; it is weighted with a Hann window.
    sample_rate_hz : float
        Its rate.

    Returns
    -------
    float or None
        In the unit of the signal; None where it is too short.
    """
    if samples.size < 0.1 * sample_rate_hz:
        return None
    window = np.hanning(samples.size)
    centred = samples - np.mean(samples)
    power = np.abs(np.fft.rfft(window * centred)) ** 2
    hz = np.fft.rfftfreq(samples.size, 1.0 / sample_rate_hz)
    within = (hz >= BAND_HZ[0]) & (hz <= BAND_HZ[1])
    # Parseval, for one-sided power and the window's own power.
    mean_square = 2.0 * np.sum(power[within]) / (samples.size * np.sum(window**2))
    return float(np.sqrt(mean_square))


def _friction_rms_n(blocks: list[Block], row: int) -> float | None:
    if any(block.data.shape[0] <= row for block in blocks):
        return None
    samples = np.concatenate([block.data[row] for block in blocks])
    value = band_rms(samples.astype(np.float64), blocks[-1].sample_rate_hz)
    return value if value is not None and np.isfinite(value) else None


def _waiting(feed: Feed[T]) -> Iterator[T]:
    """Give what waits in a feed that was made with a timeout of 0."""
    try:
        yield from feed
    except SilenceError:
        return
