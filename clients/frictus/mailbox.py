"""A bounded queue between Zenoh's threads and a reader: full, it drops its oldest entry.

What arrives is put into it by a thread that must never wait, and taken out by one that may.
"""

import asyncio
import contextlib
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Final

import zenoh

from frictus.errors import SilenceError

WAKE_S: Final = 0.2  # on Windows, Ctrl-C is only seen between waits


@dataclass(frozen=True, slots=True)
class Arrival:
    """One sample as it came.

    Attributes
    ----------
    index : int
        Counts the arrivals from 0; a jump is what this queue could not hold.
    key : str
        Key it was published under.
    payload : bytes
        The bytes, not yet decoded.
    deleted : bool
        True where a liveliness token fell.
    """

    index: int
    key: str
    payload: bytes
    deleted: bool


class EndedError(Exception):
    """The mailbox was closed; ends an iteration and is not seen outside this package."""


class Mailbox:
    """A bounded queue of arrivals that drops its oldest entry when it is full.

    Parameters
    ----------
    capacity : int
        Most arrivals held, at least 1.
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"capacity {capacity}: at least 1")
        self._items: deque[Arrival] = deque(maxlen=capacity)
        self._count = 0
        self._closed = False
        self._failure: Exception | None = None
        self._changed = threading.Condition()
        self._sleepers: list[tuple[asyncio.AbstractEventLoop, asyncio.Future[None]]] = []

    def put(self, sample: zenoh.Sample) -> None:
        """Store a sample; called by Zenoh, never blocks.

        Parameters
        ----------
        sample : zenoh.Sample
            What arrived.
        """
        arrival_key = str(sample.key_expr)
        payload = sample.payload.to_bytes()
        deleted = sample.kind == zenoh.SampleKind.DELETE
        with self._changed:
            self._items.append(Arrival(self._count, arrival_key, payload, deleted))
            self._count += 1
            self._wake()

    def close(self) -> None:
        """End every wait, now and later."""
        with self._changed:
            self._closed = True
            self._items.clear()
            self._wake()

    def fail(self, error: Exception) -> None:
        """End every wait, now and later, with an error; what is there can still be taken.

        Parameters
        ----------
        error : Exception
            What every wait raises.
        """
        with self._changed:
            self._failure = error
            self._wake()

    def wait(self, timeout_s: float) -> None:
        """Wait until there may be an arrival, or the time is over.

        Parameters
        ----------
        timeout_s : float
            Longest wait.
        """
        with self._changed:
            if not self._items and not self._closed:
                self._changed.wait(min(timeout_s, WAKE_S))

    def _wake(self) -> None:
        self._changed.notify_all()
        sleepers, self._sleepers = self._sleepers, []
        for loop, future in sleepers:
            with contextlib.suppress(RuntimeError):  # that loop has ended; nobody waits there
                loop.call_soon_threadsafe(_resolve, future)

    def take_now(self) -> Arrival | None:
        """Return the oldest arrival, or None if there is none.

        Raises
        ------
        EndedError
            If the mailbox is closed.
        """
        with self._changed:
            return self._pop()

    def _pop(self) -> Arrival | None:
        if self._closed:
            raise EndedError
        return self._items.popleft() if self._items else None

    def _pop_unless_failed(self) -> Arrival | None:
        if self._failure is not None and not self._closed:
            raise self._failure
        return self._pop()

    def take(self, timeout_s: float | None) -> Arrival:
        """Return the oldest arrival; wait for it.

        Parameters
        ----------
        timeout_s : float or None
            Longest wait; None waits for ever.

        Raises
        ------
        EndedError
            If the mailbox is closed, before or meanwhile.
        SilenceError
            If nothing arrived in time.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        with self._changed:
            while (arrival := self._pop_unless_failed()) is None:
                left = WAKE_S if deadline is None else deadline - time.monotonic()
                if left <= 0.0:
                    raise silence(timeout_s)
                self._changed.wait(min(left, WAKE_S))
            return arrival

    async def take_async(self, timeout_s: float | None) -> Arrival:
        """Return the oldest arrival; wait for it without blocking the event loop.

        Parameters
        ----------
        timeout_s : float or None
            Longest wait; None waits for ever.

        Raises
        ------
        EndedError
            If the mailbox is closed, before or meanwhile.
        SilenceError
            If nothing arrived in time.
        """
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(timeout_s):
                while True:
                    with self._changed:
                        arrival = self._pop_unless_failed()
                        if arrival is not None:
                            return arrival
                        sleeper = (loop, loop.create_future())
                        self._sleepers.append(sleeper)
                    try:
                        await sleeper[1]
                    finally:
                        with self._changed, contextlib.suppress(ValueError):
                            self._sleepers.remove(sleeper)
        except TimeoutError:
            raise silence(timeout_s) from None


def _resolve(future: "asyncio.Future[None]") -> None:
    if not future.done():
        future.set_result(None)


def silence(timeout_s: float | None) -> SilenceError:
    """Return the error of having waited in vain.

    Parameters
    ----------
    timeout_s : float or None
        How long.
    """
    return SilenceError(f"nothing arrived within {timeout_s:g} s")
