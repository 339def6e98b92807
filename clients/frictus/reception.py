"""Receiving: Zenoh's threads put into bounded queues, and readers take at their own pace.

Whatever arrives is only put into the queue; it is decoded in the reader's thread. So a slow or
stopped reader costs itself items, which are counted, and never stalls the link.
"""

import asyncio
import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import Final, Generic, Protocol, Self, TypeAlias, TypeVar

import zenoh
from zenoh.handlers import Callback

from frictus.errors import FrameError, OutdatedStateError, SilenceError

T = TypeVar("T")
log = logging.getLogger("frictus")

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
                    raise _silence(timeout_s)
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
            raise _silence(timeout_s) from None


def _resolve(future: "asyncio.Future[None]") -> None:
    if not future.done():
        future.set_result(None)


def _silence(timeout_s: float | None) -> SilenceError:
    return SilenceError(f"nothing arrived within {timeout_s:g} s")


class Declared(Protocol):
    """Anything declared in a session that can be taken back."""

    def undeclare(self) -> object:
        """Take it back."""
        ...


OnSample: TypeAlias = "Callback[zenoh.Sample]"
Declare: TypeAlias = Callable[[OnSample], Declared]


class Feed(Generic[T]):
    """What arrives under a key, in order: use it in ``for`` or in ``async for``.

    A feed receives from the moment it is made until `close`, which ends the iteration; it is a
    context manager. One reader at a time.

    Parameters
    ----------
    declare : callable
        Declares the subscriber for a given callback.
    decode : callable
        Turns one arrival into the items it stands for; `FrameError` skips and counts it.
    capacity : int
        Arrivals held for a slow reader; beyond, the oldest go.
    timeout_s : float or None
        Longest silence before `SilenceError`; None waits for ever.

    Attributes
    ----------
    unreadable : int
        Arrivals that were not a message of the protocol; each is also logged.
    """

    def __init__(
        self,
        declare: Declare,
        decode: Callable[[Arrival], Iterable[T]],
        capacity: int,
        timeout_s: float | None = None,
    ) -> None:
        self._mailbox = Mailbox(capacity)
        self._decode = decode
        self._timeout_s = timeout_s
        self._ready: deque[T] = deque()
        self.unreadable = 0
        # A direct callback: an indirect one needs a thread that outlives a forgotten close().
        self._declared: Declared | None = declare(Callback(self._mailbox.put, indirect=False))

    @property
    def closed(self) -> bool:
        """Whether the feed has ended."""
        return self._declared is None

    def close(self) -> None:
        """Stop receiving and end the iteration. Closing twice is harmless."""
        self._mailbox.close()
        declared, self._declared = self._declared, None
        if declared is not None:
            with contextlib.suppress(zenoh.ZError):  # the session went first
                declared.undeclare()

    def fail(self, error: Exception) -> None:
        """End the iteration with an error, for good; `drain` goes on.

        Parameters
        ----------
        error : Exception
            What every wait raises.
        """
        self._mailbox.fail(error)

    def _accept(self, arrival: Arrival) -> None:
        try:
            self._ready.extend(_decoded(lambda one: list(self._decode(one)), arrival))
        except FrameError as error:
            self.unreadable += 1
            log.warning("skipped what arrived under %s: %s", arrival.key, error)

    def drain(self) -> list[T]:
        """Return what is there, without waiting.

        Raises
        ------
        RuntimeError
            If the feed is closed.
        """
        try:
            while (arrival := self._mailbox.take_now()) is not None:
                self._accept(arrival)
        except EndedError:
            raise RuntimeError("this feed is closed") from None
        found = list(self._ready)
        self._ready.clear()
        return found

    def __iter__(self) -> Self:
        """Return self."""
        return self

    def __next__(self) -> T:
        """Return the next item; wait for it.

        Raises
        ------
        SilenceError
            If nothing arrived within `timeout_s`.
        """
        try:
            while not self._ready:
                self._accept(self._mailbox.take(self._timeout_s))
        except EndedError:
            raise StopIteration from None
        return self._ready.popleft()

    def __aiter__(self) -> Self:
        """Return self."""
        return self

    async def __anext__(self) -> T:
        """Return the next item; wait for it without blocking the event loop.

        Raises
        ------
        SilenceError
            If nothing arrived within `timeout_s`.
        """
        try:
            while not self._ready:
                self._accept(await self._mailbox.take_async(self._timeout_s))
        except EndedError:
            raise StopAsyncIteration from None
        return self._ready.popleft()

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()

    async def __aenter__(self) -> Self:
        """Return self."""
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()


def _decoded(decode: Callable[[Arrival], T], arrival: Arrival) -> T:
    """Decode an arrival; whatever fails on it, it is a `FrameError`: none ends its reader."""
    try:
        return decode(arrival)
    except FrameError:
        raise
    except Exception as error:
        raise FrameError(f"{type(error).__name__}: {error}") from error


class Latest(Generic[T]):
    """The newest value under a key; also the one published before we came.

    Parameters
    ----------
    declare : callable
        Declares the subscriber for a given callback.
    decode : callable
        Turns an arrival into the value; may raise `FrameError`.
    """

    def __init__(self, declare: Declare, decode: Callable[[Arrival], T]) -> None:
        self._mailbox = Mailbox(1)
        self._decode = decode
        self._value: T | None = None
        self._reading = threading.Lock()
        self._expected: Callable[[T], bool] | None = None
        self._expected_until_s = 0.0
        self._declared: Declared | None = declare(Callback(self._mailbox.put, indirect=False))

    @property
    def closed(self) -> bool:
        """Whether it no longer receives."""
        return self._declared is None

    def expect(self, holds: Callable[[T], bool], within_s: float) -> None:
        """Have `value` wait for what the publisher is known to be about to publish.

        Parameters
        ----------
        holds : callable
            Whether a value includes it.
        within_s : float
            Longest wait, from now.
        """
        self._expected, self._expected_until_s = holds, time.monotonic() + within_s

    def value(self, timeout_s: float) -> T:
        """Return the newest value; wait for the first one, and for what is expected.

        Parameters
        ----------
        timeout_s : float
            Longest wait.

        Raises
        ------
        SilenceError
            If none came.
        OutdatedStateError
            If what is expected did not come in time; from then on without a wait, until it
            does.
        FrameError
            If the newest is not a message of the protocol.
        """
        deadline_s = time.monotonic() + timeout_s
        while True:
            with self._reading:  # never held while waiting: a lease reads the same status
                value = self._take()
                if value is not None and (self._expected is None or self._expected(value)):
                    self._expected = None
                    return value
                until_s = deadline_s if value is None else self._expected_until_s
            left_s = min(deadline_s, until_s) - time.monotonic()
            if left_s > 0.0:
                self._mailbox.wait(left_s)
            elif value is None:
                raise _silence(timeout_s)
            else:
                raise OutdatedStateError(
                    "what was confirmed has not been published in time, and what was said "
                    "before is out of date: its publisher stands still or is overloaded"
                )

    def newest(self) -> T | None:
        """Return the newest value, None without any; neither waits nor looks what is expected.

        Raises
        ------
        FrameError
            If it is not a message of the protocol.
        """
        with self._reading:
            return self._take()

    def _take(self) -> T | None:
        arrival = self._mailbox.take_now()
        if arrival is not None:
            self._value = _decoded(self._decode, arrival)
        return self._value

    def close(self) -> None:
        """Stop receiving."""
        self._mailbox.close()
        declared, self._declared = self._declared, None
        if declared is not None:
            with contextlib.suppress(zenoh.ZError):  # the session went first
                declared.undeclare()
