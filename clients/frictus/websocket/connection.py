"""The connection: hello, requests and answers, what the service sends, silence noticed."""

import asyncio
import contextlib
import itertools
import json
import logging
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar, get_args

from pydantic import ValidationError

from frictus.errors import (
    ArgumentError,
    LinkError,
    OutcomeUnknownError,
    RefusedError,
    explain,
)
from frictus.messages import MESSAGES, Message
from frictus.websocket.frames import Frame, is_known
from frictus.websocket.messages import (
    MAX_BYTES,
    VALUES,
    Asked,
    Ping,
    Pong,
    Refused,
    Told,
    Welcome,
)

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection

log = logging.getLogger("frictus")

PING_S: Final = 0.5
QUIET_PINGS: Final = 6
"""A service that sends nothing, no pong either, for so many pings is taken for dead."""
CLOCK_READINGS: Final = 16
_TOLD: Final[dict[str, type[Message]]] = {
    get_args(kind.model_fields["op"].annotation)[0]: kind for kind in get_args(Told)
}
A = TypeVar("A", bound=Message)


class RigValue(NamedTuple):
    """A message of a rig that the service has passed on."""

    op: str
    rig: str
    message: Message


Heard = Frame | RigValue | Message


class _Waiting(NamedTuple):
    op: str
    kind: type[Message]
    answer: "asyncio.Future[Message]"
    take: Callable[[Any], None]


class Connection:
    """A connection that was welcomed. Made by `opening.opened`.

    Parameters
    ----------
    socket : ClientConnection
        Of the library `websockets`.
    welcome : Welcome
        What the service said of itself and of us.
    hear : callable
        Called in the event loop with everything that the service sends but pongs.
    on_end : callable
        Called once with the error when the connection ends before it is closed here.
    """

    def __init__(
        self,
        socket: "ClientConnection",
        welcome: Welcome,
        hear: Callable[[Heard], None],
        on_end: Callable[[LinkError], None],
    ) -> None:
        self.welcome = welcome
        self._socket = socket
        self._hear = hear
        self._on_end = on_end
        self._ids = itertools.count()
        self._waiting: dict[int, _Waiting] = {}
        self._refusal: Refused | None = None
        self._clock_us: deque[int] = deque(maxlen=CLOCK_READINGS)
        self._quiet = 0
        self._failure: LinkError | None = None
        self._read_clock(welcome.utc_us)
        self._tasks = [asyncio.create_task(self._read()), asyncio.create_task(self._ping())]

    @property
    def utc_ns(self) -> int:
        """The service's clock, ns; behind it by the fastest trip of a message, never ahead."""
        return 1_000 * (time.monotonic_ns() // 1_000 + max(self._clock_us))

    async def ask(
        self,
        asked: Asked,
        answer: type[A],
        timeout_s: float,
        take: Callable[[A], None] = lambda _: None,
    ) -> A:
        """Send a request and return its answer.

        Parameters
        ----------
        asked : Asked
            With an `id` of `next_id`.
        answer : type
            Of the answer.
        timeout_s : float
            Longest wait for it.
        take : callable
            Called with the answer before anything that comes behind it is heard.

        Raises
        ------
        RefusedError
            If it is refused.
        OutcomeUnknownError
            If no answer came, or the connection ended first.
        ArgumentError, LinkError
            As `say`.
        """
        number: int = asked.id  # type: ignore[union-attr, assignment]
        future: asyncio.Future[Message] = asyncio.get_running_loop().create_future()
        waiting = _Waiting(asked.op, answer, future, take)
        self._waiting[number] = waiting
        try:
            await self.say(asked)
            async with asyncio.timeout(timeout_s):
                answered = await waiting.answer
                assert isinstance(answered, answer)
                return answered
        except TimeoutError:
            raise OutcomeUnknownError(
                f"{asked.op} was sent and not answered within {timeout_s:g} s: read what it "
                "was to change before it is sent again"
            ) from None
        finally:
            del self._waiting[number]

    def next_id(self) -> int:
        """Return the `id` of the next request."""
        return next(self._ids)

    async def say(self, asked: Asked) -> None:
        """Send a message.

        Parameters
        ----------
        asked : Asked
            Checked by its model, so that the service does not end the connection over it.

        Raises
        ------
        ArgumentError
            If it is too large.
        LinkError
            If the connection has ended.
        """
        text = asked.model_dump_json(by_alias=True)
        if len(text.encode()) > MAX_BYTES:
            raise ArgumentError(
                f"{asked.op} of {len(text)} bytes: at most {MAX_BYTES}; a larger scene goes by "
                "REST, PUT /v1/rigs/RIG/scene"
            )
        await self.send(text)

    async def send(self, data: str | bytes) -> None:
        """Send a message or an update as it is; waits while the network takes none.

        Parameters
        ----------
        data : str or bytes
            Text or binary message.

        Raises
        ------
        LinkError
            If the connection has ended.
        """
        from websockets.exceptions import ConnectionClosed

        if self._failure is not None:
            raise self._failure
        try:
            await self._socket.send(data)
        except ConnectionClosed as error:
            raise self._lose(why_closed(error)) from None

    async def close(self) -> None:
        """Close; the service disarms what is armed over it."""
        self._end(LinkError("this client is closed; connect again"))
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._socket.close()

    def _end(self, failure: LinkError) -> None:
        self._failure = failure
        for task in self._tasks:
            if task is not asyncio.current_task():
                task.cancel()
        for waiting in self._waiting.values():
            if not waiting.answer.done():
                unknown = f"{waiting.op} was sent and not answered: {failure}"
                waiting.answer.set_exception(OutcomeUnknownError(unknown))

    def _lose(self, reason: str) -> LinkError:
        """End the connection from a fault; return the error that all get from now on."""
        if self._failure is None:
            failure = LinkError(f"the connection to the service is lost: {reason}")
            log.warning("%s", failure)
            self._end(failure)
            self._socket.transport.abort()  # so that the service disarms now
            self._on_end(failure)
        assert self._failure is not None
        return self._failure

    async def _read(self) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            while True:
                data = await self._socket.recv()
                self._quiet = 0
                self._take(data)
        except ConnectionClosed as error:
            reason, refusal = why_closed(error), self._refusal
            if refusal is not None and refusal.code == reason:
                reason = f"{reason}: {refusal.message}"
            self._lose(reason)
        except (ValueError, TypeError, LookupError, OverflowError, RecursionError) as error:
            told = explain(error) if isinstance(error, ValidationError) else str(error)
            self._lose(f"it sent what cannot be read: {told}")

    def _take(self, data: str | bytes) -> None:
        if isinstance(data, bytes):
            if is_known(data):
                self._hear(Frame.unpack(data))
            return
        told = json.loads(data)
        op = told["op"]
        if op in VALUES:
            kind = MESSAGES[VALUES[op].message]
            self._hear(RigValue(op, str(told["rig"]), kind.model_validate(told[op])))
        elif op in _TOLD:  # else of a later 1.x
            self._answered(_TOLD[op].model_validate(told))

    def _answered(self, message: Message) -> None:
        if isinstance(message, Pong):
            self._read_clock(message.utc_us)
            return
        number = getattr(message, "id", None)
        waiting = None if number is None else self._waiting.get(number)
        if isinstance(message, Refused):
            self._refuse(message, waiting)
        elif waiting is not None and not waiting.answer.done():
            if not isinstance(message, waiting.kind):
                raise ValueError(f"{waiting.op} was answered with {type(message).__name__}")
            waiting.take(message)
            waiting.answer.set_result(message)
        self._hear(message)

    def _refuse(self, refused: Refused, waiting: _Waiting | None) -> None:
        """Fail the request that is refused, by its name where it came without its number."""
        error = RefusedError(refused.code, refused.message)
        self._refusal = refused
        for other in self._waiting.values() if waiting is None else (waiting,):
            if other.op == refused.what and not other.answer.done():
                other.answer.set_exception(error)

    async def _ping(self) -> None:
        while True:
            await asyncio.sleep(PING_S)
            # Counted while this loop runs: a program that blocked it has heard nothing either.
            if self._quiet >= QUIET_PINGS and not self._waiting:
                self._lose("it has fallen silent")
                return
            self._quiet += 1
            with contextlib.suppress(TimeoutError, LinkError):
                async with asyncio.timeout(PING_S):
                    await self.say(Ping(op="ping", id=self.next_id()))

    def _read_clock(self, utc_us: int) -> None:
        self._clock_us.append(utc_us - time.monotonic_ns() // 1_000)


def why_closed(error: Any) -> str:
    """Return why a connection was closed.

    Parameters
    ----------
    error : ConnectionClosed
        Of the library `websockets`.
    """
    received = error.rcvd
    return received.reason or f"code {received.code}" if received else "it is gone"
