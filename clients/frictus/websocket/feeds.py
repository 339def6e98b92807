"""What arrives, in bounded queues: use a feed in ``async for``."""

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from frictus.block import Flag
from frictus.errors import FrameError
from frictus.keys import CHANNELS
from frictus.mailbox import silence
from frictus.websocket.frames import FINGER_ROWS, FingerFlag, Frame


@dataclass(frozen=True, slots=True)
class SampleChunk:
    """Samples of one stream that follow one another; a `frictus.Block` of any length.

    Attributes
    ----------
    stream : int
        Which stream, a key of `frictus.keys.STREAMS`.
    run : int
        Changes when the rig starts anew; sample counts begin again with it.
    first_sample : int
        Device index of the first sample.
    lost : int
        Samples missing between those before of this feed and these: on the way, or because
        this reader was too slow for its queue.
    utc_ns : int
        UTC of the first sample, by the rig's clock.
    sample_rate_hz : float
        Nominal rate of the device clock.
    flags : Flag
        What a reader must know of these samples; bits of all their blocks.
    data : ndarray of float32, shape (n_channels, n_samples)
        The samples, in the unit of the stream.
    """

    stream: int
    run: int
    first_sample: int
    lost: int
    utc_ns: int
    sample_rate_hz: float
    flags: Flag
    data: NDArray[np.float32]

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.data.shape[1])

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the rows of `data`, with their units; empty for the stream `aux`."""
        return CHANNELS.get(self.stream, ())

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Seconds of the device's clock since its sample 0, shape (n_samples,)."""
        samples = self.first_sample + np.arange(self.count)
        time_s: NDArray[np.float64] = samples / self.sample_rate_hz
        return time_s


@dataclass(frozen=True, slots=True)
class FingerSample:
    """Where the finger is and how it moves; the names are those of `frictus.FingerState`.

    Attributes
    ----------
    run : int
        Of the rig.
    sample : int
        Device sample index this state holds for.
    lost : int
        States missing between the one before of this feed and this one; they are a block apart.
    utc_ns : int
        UTC of `sample`, by the rig's clock.
    x_mm, y_mm, vx_mm_s, vy_mm_s : float
        Position and velocity.
    normal_force_n : float
        How hard it presses, N.
    age_ms : float
        Age of the touch report behind it.
    in_contact, stale, extrapolated : bool
        Whether it touches; whether the report is too old; whether its speed is beyond where
        the model holds.
    """

    run: int
    sample: int
    lost: int
    utc_ns: int
    x_mm: float
    y_mm: float
    vx_mm_s: float
    vy_mm_s: float
    normal_force_n: float
    age_ms: float
    in_contact: bool
    stale: bool
    extrapolated: bool

    @property
    def count(self) -> int:
        """One state."""
        return 1


def samples_of(frame: Frame) -> SampleChunk:
    """Return the samples of a raw frame.

    Parameters
    ----------
    frame : Frame
        Of kind `Kind.RAW`.
    """
    return SampleChunk(
        frame.stream,
        frame.run,
        frame.first_sample,
        frame.lost_samples,
        frame.utc_ns,
        frame.sample_rate_hz,
        Flag(frame.flags),
        frame.data,
    )


def fingers_of(frame: Frame) -> list[FingerSample]:
    """Return the states of a frame of the finger.

    Parameters
    ----------
    frame : Frame
        Of kind `Kind.FINGER`.

    Raises
    ------
    FrameError
        If it has too few rows, or a rate that is not above 0.
    """
    if len(frame.data) < len(FINGER_ROWS) or not frame.sample_rate_hz > 0.0:
        raise FrameError(
            f"{len(frame.data)} rows of the finger at {frame.sample_rate_hz:g} Hz: "
            f"{len(FINGER_ROWS)} rows, above 0 Hz, are known"
        )
    states = []
    for index, column in enumerate(frame.data[: len(FINGER_ROWS)].T.astype(float).tolist()):
        since, x_mm, y_mm, vx_mm_s, vy_mm_s, normal_force_n, age_ms, bits = column
        flags = FingerFlag(int(bits) & 0b111)
        states.append(
            FingerSample(
                frame.run,
                frame.first_sample + int(since),
                0 if index else frame.lost_samples,
                frame.utc_ns + round(1e9 * since / frame.sample_rate_hz),
                x_mm,
                y_mm,
                vx_mm_s,
                vy_mm_s,
                normal_force_n,
                age_ms,
                FingerFlag.IN_CONTACT in flags,
                FingerFlag.STALE in flags,
                FingerFlag.EXTRAPOLATED in flags,
            )
        )
    return states


T = TypeVar("T")
Counted = TypeVar("Counted", SampleChunk, FingerSample)


class AsyncFeed(Generic[T]):
    """What arrives, in order, from when it is made until `close`, which ends the iteration.

    An asynchronous context manager that closes it. One reader at a time.

    Parameters
    ----------
    capacity : int
        Items held for a slow reader, at least 1; beyond, the oldest go.
    timeout_s : float or None
        Longest silence before `SilenceError`; None waits for ever.
    on_close : callable
        Called with the feed once it is closed.
    """

    def __init__(
        self,
        capacity: int,
        timeout_s: float | None,
        on_close: Callable[["AsyncFeed[Any]"], None],
    ) -> None:
        if capacity < 1:
            raise ValueError(f"capacity {capacity}: at least 1")
        self._items: deque[T] = deque()
        self._capacity = capacity
        self._timeout_s = timeout_s
        self._on_close = on_close
        self._changed = asyncio.Event()
        self._failure: Exception | None = None
        self._closed = False

    @property
    def closed(self) -> bool:
        """Whether the feed has ended."""
        return self._closed

    def put(self, item: T) -> None:
        """Take in what has arrived.

        Parameters
        ----------
        item : object
            Behind those before.
        """
        if len(self._items) == self._capacity:
            self._drop(self._items.popleft())
        self._items.append(item)
        self._changed.set()

    def fail(self, error: Exception) -> None:
        """End the iteration with an error, for good, once what is there has been taken.

        Parameters
        ----------
        error : Exception
            What every wait raises.
        """
        self._failure = self._failure or error
        self._changed.set()

    def close(self) -> None:
        """End the iteration. Closing twice is harmless."""
        if not self._closed:
            self._closed = True
            self._changed.set()
            self._on_close(self)

    def _drop(self, item: T) -> None:
        """Take note of an item that this reader was too slow for."""

    def _hand_over(self, item: T) -> T:
        return item

    def __aiter__(self) -> Self:
        """Return self."""
        return self

    async def __anext__(self) -> T:
        """Return the next item.

        Raises
        ------
        SilenceError
            If nothing arrived in time.
        LinkError
            If the connection is lost.
        LeaseLostError
            For `AsyncRig.fingers` alone: if a lease of this client on the rig is lost.
        """
        try:
            async with asyncio.timeout(self._timeout_s):
                while not self._closed and not self._items:
                    if self._failure is not None:
                        raise self._failure
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            raise silence(self._timeout_s) from None
        if self._closed:
            raise StopAsyncIteration
        return self._hand_over(self._items.popleft())

    async def __aenter__(self) -> Self:
        """Return self."""
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close."""
        self.close()


class CountedFeed(AsyncFeed[Counted]):
    """A feed that knows what is missing in it.

    Parameters
    ----------
    capacity : int
        Items held.
    timeout_s : float or None
        Longest silence.
    on_close : callable
        Called once it is closed.

    Attributes
    ----------
    lost : int
        Samples, or states, that are missing so far.
    """

    def __init__(
        self,
        capacity: int,
        timeout_s: float | None,
        on_close: Callable[[AsyncFeed[Any]], None],
    ) -> None:
        super().__init__(capacity, timeout_s, on_close)
        self.lost = 0
        self._dropped = 0

    def _drop(self, item: Counted) -> None:
        self._dropped += item.lost + item.count

    def _hand_over(self, item: Counted) -> Counted:
        lost, self._dropped = item.lost + self._dropped, 0
        self.lost += lost
        return replace(item, lost=lost)
