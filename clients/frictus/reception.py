"""Receiving: Zenoh's threads put into bounded queues, and readers take at their own pace.

Whatever arrives is only put into the queue; it is decoded in the reader's thread. So a slow or
stopped reader costs itself items, which are counted, and never stalls the link.
"""

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Final, Generic, Protocol, Self, TypeAlias, TypeVar

import zenoh
from zenoh.handlers import Callback

from frictus.closing import Closing
from frictus.errors import FrameError, LinkError, OutdatedStateError
from frictus.mailbox import Arrival, EndedError, Mailbox, silence

T = TypeVar("T")
log = logging.getLogger("frictus")


class Declared(Protocol):
    """Anything declared in a session that can be taken back."""

    def undeclare(self) -> object:
        """Take it back."""
        ...


OnSample: TypeAlias = "Callback[zenoh.Sample]"
Declare: TypeAlias = Callable[[OnSample], Declared]


class _Subscription(Closing):
    """A mailbox, and the subscriber that fills it."""

    def __init__(self, declare: Declare, capacity: int) -> None:
        self._mailbox = Mailbox(capacity)
        # A direct callback: an indirect one needs a thread that outlives a forgotten close().
        self._declared: Declared | None = declare(Callback(self._mailbox.put, indirect=False))

    @property
    def closed(self) -> bool:
        """Whether it no longer receives."""
        return self._declared is None

    def close(self) -> None:
        """Stop receiving; an iteration ends. Closing twice is harmless."""
        self._mailbox.close()
        declared, self._declared = self._declared, None
        if declared is not None:
            with contextlib.suppress(zenoh.ZError):  # the session went first
                declared.undeclare()


class Feed(_Subscription, Generic[T]):
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
        super().__init__(declare, capacity)
        self._decode = decode
        self._timeout_s = timeout_s
        self._ready: deque[T] = deque()
        self.unreadable = 0

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

    async def __aenter__(self) -> Self:
        """Return self."""
        return self

    async def __aexit__(self, *_: object) -> None:
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


SET_BACK_NS: Final = 1_000_000_000
"""A publisher whose clock is set back by more would be out of date until it has caught up."""


def _utc_ns(value: object) -> int:
    return getattr(value, "utc_ns", None) or 0


class Latest(_Subscription, Generic[T]):
    """The newest value under a key; also the one published before we came.

    Parameters
    ----------
    declare : callable
        Declares the subscriber for a given callback.
    decode : callable
        Turns an arrival into the value; may raise `FrameError`.
    """

    def __init__(self, declare: Declare, decode: Callable[[Arrival], T]) -> None:
        super().__init__(declare, 1)
        self._decode = decode
        self._value: T | None = None
        self._reading = threading.Lock()
        self._expected: Callable[[T], bool] | None = None
        self._expected_until_s = 0.0
        self._confirmed_ns = 0

    def expect(
        self,
        confirmed_ns: int | None,
        within_s: float,
        includes: Callable[[T], bool] = lambda _: False,
    ) -> None:
        """Have `value` wait for what the publisher is known to be about to publish.

        Parameters
        ----------
        confirmed_ns : int or None
            When it was confirmed, UTC by the publisher's clock, ns: a value from then on
            includes it. None where that is not known.
        within_s : float
            Longest wait, from now.
        includes : callable
            Whether a value includes it whenever it is from.
        """

        def holds(value: T) -> bool:
            later = confirmed_ns is not None and _utc_ns(value) >= confirmed_ns
            return later or includes(value)

        self._expected, self._expected_until_s = holds, time.monotonic() + within_s
        self._confirmed_ns = confirmed_ns or 0

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
        LinkError
            If the client was closed meanwhile.
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
                raise silence(timeout_s)
            else:
                raise OutdatedStateError(
                    "what was confirmed has not been published in time, and what was said "
                    "before is out of date: its publisher stands still or is overloaded"
                )

    def newest(self) -> T | None:
        """Return the newest value, None without any; neither waits nor looks what is expected.

        What is not a message of the protocol is passed over: anybody may have published it.

        Raises
        ------
        LinkError
            If the client was closed.
        """
        with self._reading:
            with contextlib.suppress(FrameError):
                self._take()
            return self._value

    def _take(self) -> T | None:
        try:
            arrival = self._mailbox.take_now()
        except EndedError:
            raise LinkError("the client was closed; connect again") from None
        if arrival is not None:
            before_ns = _utc_ns(self._value)
            self._value = _decoded(self._decode, arrival)
            if _utc_ns(self._value) < min(before_ns, self._confirmed_ns) - SET_BACK_NS:
                self._expected = None  # this came later, whatever the clock says
        return self._value
