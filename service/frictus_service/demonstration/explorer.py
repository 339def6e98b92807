"""The client of the demo, in a process of its own: it streams a texture and is timed."""

import contextlib
import threading
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Final

import numpy as np
from numpy.typing import NDArray

import frictus
from frictus import Block, Gap
from frictus.errors import SilenceError
from frictus.gaps import BlockFeed
from frictus.messages import Applied
from frictus.rig import Rig
from frictus.stream import TextureStream
from frictus.textures import Spectrum
from frictus.watched_rig import StreamName
from frictus_hardware.physics.screen import Screen, screen_voltage

CHANGED_V: Final = 0.01
"""Far above the rounding to float32, far below what an update does within a millisecond."""


def changed_samples(block: Block, screen: Screen, bias: float) -> NDArray[np.intp]:
    """Return the samples of a voltage block that are not what the bias alone gives.

    Parameters
    ----------
    block : Block
        Monitor volts.
    screen : Screen
        Its peak voltage, carrier and size.
    bias : float
        Drive fraction without texture.
    """
    voltage_v = block.data[0].astype(float)
    drive = np.full(voltage_v.size, bias)
    known_v = screen_voltage(screen, drive, block.first_sample, block.sample_rate_hz)
    return np.flatnonzero(np.abs(voltage_v - known_v) > CHANGED_V)


PERIOD_MM: Final = 32.0
SAMPLES: Final = 2048
BLOCKS_PER_S: Final = 200.0
SEND_S: Final = 0.1
TTL_MS: Final = 2_000
"""A busy machine that holds the sender up for a second changes nothing."""
LATENCY_UPDATES: Final = 8
BLINK_TTL_MS: Final = 60


@dataclass(frozen=True, slots=True)
class Heard:
    """What came back from the rig.

    Attributes
    ----------
    first_sample : int
        Device index of the first sample of `truth`.
    truth : ndarray of float32, shape (5, n_samples)
        x, y, vx, vy, friction, as the stream of that name; NaN where blocks were lost.
    applied : Applied
        Gain and bias, as the rig applied them.
    received, lost : dict of str to int
        Blocks of each stream.
    latency_ms : list of float
        From sending an update to the first changed sample at the DAC.
    """

    first_sample: int
    truth: NDArray[np.float32]
    applied: Applied
    received: dict[str, int]
    lost: dict[str, int]
    latency_ms: list[float]


def profile_of(texture: Spectrum) -> NDArray[np.float64]:
    """Return one period of 32 mm of a spatial spectrum whose lines all repeat after it, N."""
    at = np.arange(SAMPLES) / SAMPLES
    friction = np.zeros(SAMPLES)
    for line in texture.components:
        assert line.cycles_per_mm is not None  # the shipped fits are spatial
        turns = round(line.cycles_per_mm * PERIOD_MM)
        friction += line.amplitude_n * np.cos(2.0 * np.pi * turns * at + line.phase_rad)
    return friction


def peak_of(friction_n: NDArray[np.float64]) -> float:
    """Return the peak to declare, N: leaving out high lines may raise it a little."""
    return 1.25 * float(np.abs(friction_n).max())


def explore(
    router: str,
    site: str,
    name: str,
    texture: Spectrum,
    seconds: float,
    told: "Connection[Heard | str, object]",
) -> None:
    """Stream a texture for a while and send what was heard through `told`.

    Parameters
    ----------
    router, site, name : str
        Where the rig is.
    texture : Spectrum
        To be streamed.
    seconds : float
        Of exploration, after the latency was measured.
    told : Connection
        Gets a `Heard`, or the text of an error.
    """
    try:
        with frictus.connect(router, "demo-explorer") as client:
            rig = client.rig(name, site, wait_s=5.0)
            told.send(_explore(rig, profile_of(texture), seconds))
    except Exception as error:
        told.send(f"{type(error).__name__}: {error}")
        raise


def _explore(rig: Rig, friction_n: NDArray[np.float64], seconds: float) -> Heard:
    with rig.arm(), rig.open_stream(peak_of(friction_n)) as stream:
        assert stream.applied is not None  # an opened stream says what it applied
        latency_ms = measure_latency(rig, stream, friction_n, stream.applied.bias)
        truth = rig.blocks("truth", timeout_s=5.0)
        capacity = round(2.0 * (seconds + 5.0) * BLOCKS_PER_S)
        others: dict[StreamName, BlockFeed] = {
            other: rig.blocks(other, capacity=capacity, timeout_s=0.0)
            for other in ("force", "accel", "voltage")
        }
        over = threading.Event()
        sender = threading.Thread(target=_keep_sending, args=(stream, friction_n, over))
        sender.start()
        blocks: list[Block] = []
        try:
            first_sample = _first_changed(rig, stream.applied.bias)
            deadline_s = time.monotonic() + seconds
            for item in truth:
                if isinstance(item, Block) and item.first_sample >= first_sample:
                    blocks.append(item)
                if time.monotonic() >= deadline_s:
                    break
        finally:
            over.set()
            sender.join()
        for feed in others.values():
            with contextlib.suppress(SilenceError):  # its queue holds no more
                for _ in feed:
                    pass
        listening = {"truth": truth, **others}
        return Heard(
            blocks[0].first_sample,
            _joined(blocks),
            stream.applied,
            {key: feed.received for key, feed in listening.items()},
            {key: feed.lost for key, feed in listening.items()},
            latency_ms,
        )


def _first_changed(rig: Rig, bias: float) -> int:
    """Return the first sample that a texture changed: before it only the bias was felt."""
    screen = Screen(peak_v=rig.status().screen_peak_v)
    with rig.blocks("voltage", timeout_s=5.0) as voltage:
        while True:
            item = next(voltage)
            if isinstance(item, Block):
                changed = changed_samples(item, screen, bias)
                if changed.size:
                    return item.first_sample + int(changed[0])


def _keep_sending(
    stream: TextureStream, friction_n: NDArray[np.float64], over: threading.Event
) -> None:
    while not over.is_set():
        stream.send(friction_n, period_mm=PERIOD_MM, ttl_ms=TTL_MS)
        over.wait(SEND_S)


def _joined(blocks: list[Block]) -> NDArray[np.float32]:
    first = blocks[0].first_sample
    last = blocks[-1]
    joined = np.full(
        (last.data.shape[0], last.first_sample + last.data.shape[1] - first), np.nan, np.float32
    )
    for block in blocks:
        at = block.first_sample - first
        joined[:, at : at + block.data.shape[1]] = block.data
    return joined


def measure_latency(
    rig: Rig,
    stream: TextureStream,
    friction_n: NDArray[np.float64],
    bias: float,
) -> list[float]:
    """Send updates that each fade again, and find the first changed sample at the DAC, ms.

    It returns once the last of `LATENCY_UPDATES` has faded.

    Parameters
    ----------
    rig : Rig
        An open rig of this client.
    stream : TextureStream
        Just opened: only the bias is felt.
    friction_n : ndarray, shape (n_samples,)
    bias : float
        Drive fraction without texture.
    """
    latencies: list[float] = []
    screen = Screen(peak_v=rig.status().screen_peak_v)
    with rig.blocks("voltage", timeout_s=5.0) as voltage:
        sent_ns: int | None = None
        steady = 0
        for item in voltage:
            if isinstance(item, Gap):
                steady, sent_ns = 0, None
                continue
            changed = changed_samples(item, screen, bias)
            if sent_ns is None:
                steady = 0 if changed.size else steady + 1
                if steady >= 3:
                    if len(latencies) == LATENCY_UPDATES:
                        break
                    sent_ns = time.time_ns()
                    stream.send(friction_n, period_mm=PERIOD_MM, ttl_ms=BLINK_TTL_MS)
            elif changed.size:
                sample_ns = item.utc_ns + round(1e9 * int(changed[0]) / item.sample_rate_hz)
                latencies.append((sample_ns - sent_ns) / 1e6)
                steady, sent_ns = 0, None
    return latencies
