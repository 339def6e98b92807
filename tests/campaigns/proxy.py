"""A link between hosts that delays, loses, throttles, stalls and cuts.

TCP hides a lost segment: what follows waits until it was sent again. So a loss is a pause here.
"""

import asyncio
import random
import threading
from dataclasses import dataclass
from types import TracebackType
from typing import Final, Self

SEGMENT_BYTES: Final = 1_460
RETRANSMISSION_S: Final = 0.2
"""Linux's least time until a segment is sent again."""
IN_FLIGHT: Final = 1_024
"""Pieces that a direction holds; beyond, the sender has to wait."""


@dataclass(frozen=True, slots=True)
class Impairment:
    """What a link does to each direction.

    Attributes
    ----------
    delay_s : float
        One way.
    jitter_s : float
        Up to so much more, drawn for each piece; the order stays.
    loss : float
        Share of segments that have to be sent again.
    rate_bytes_s : float
        Its capacity.
    """

    delay_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    rate_bytes_s: float = float("inf")


class Proxy:
    """Passes TCP connections on to a port of this machine; use it in ``with``.

    Parameters
    ----------
    port : int
        Where connections are passed on to.
    impairment : Impairment
    seed : int
        Of jitter and losses.
    """

    def __init__(self, port: int, impairment: Impairment, seed: int) -> None:
        self._to = port
        self._impairment = impairment
        self._rng = random.Random(seed)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="proxy")
        self._flowing = asyncio.Event()
        self._flowing.set()
        self._cut = False
        self._transports: set[asyncio.WriteTransport] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self.port = 0
        """Where this listens."""

    def stall(self) -> None:
        """Hold everything back; connections stay."""
        self._loop.call_soon_threadsafe(self._flowing.clear)

    def cut(self) -> None:
        """Break all connections, and refuse new ones."""

        def apply() -> None:
            self._cut = True
            self._abort()

        self._loop.call_soon_threadsafe(apply)

    def mend(self) -> None:
        """End a stall or a cut."""

        def apply() -> None:
            self._cut = False
            self._flowing.set()

        self._loop.call_soon_threadsafe(apply)

    def _abort(self) -> None:
        for transport in tuple(self._transports):
            transport.abort()

    async def _accept(self, near: asyncio.StreamReader, back: asyncio.StreamWriter) -> None:
        if self._cut:
            back.transport.abort()
            return
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        far, forth = await asyncio.open_connection("127.0.0.1", self._to)
        ends = {back.transport, forth.transport}
        self._transports |= ends
        try:
            async with asyncio.TaskGroup() as group:
                for reader, writer in ((near, forth), (far, back)):
                    pieces: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(IN_FLIGHT)
                    group.create_task(self._take(reader, pieces))
                    group.create_task(self._give(pieces, writer))
        except* ConnectionError:
            pass  # either end is gone: so is the other
        finally:
            self._transports -= ends
            self._tasks.discard(task)
            for end in ends:
                end.abort()

    async def _take(
        self, reader: asyncio.StreamReader, pieces: "asyncio.Queue[tuple[float, bytes]]"
    ) -> None:
        link, due_s = self._impairment, 0.0
        while piece := await reader.read(10 * SEGMENT_BYTES):
            now_s = self._loop.time()
            arrival_s = now_s + link.delay_s + self._rng.uniform(0.0, link.jitter_s)
            due_s = max(due_s, arrival_s) + len(piece) / link.rate_bytes_s
            segments = -(-len(piece) // SEGMENT_BYTES)
            if self._rng.random() > (1.0 - link.loss) ** segments:
                due_s += RETRANSMISSION_S + 2.0 * link.delay_s
            await pieces.put((due_s, piece))
        raise ConnectionResetError("one end has closed")

    async def _give(
        self, pieces: "asyncio.Queue[tuple[float, bytes]]", writer: asyncio.StreamWriter
    ) -> None:
        while True:
            due_s, piece = await pieces.get()
            await asyncio.sleep(max(0.0, due_s - self._loop.time()))
            await self._flowing.wait()
            writer.write(piece)
            await writer.drain()

    async def _listen(self) -> asyncio.Server:
        server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        self.port = server.sockets[0].getsockname()[1]
        return server

    async def _close(self) -> None:
        self._server.close()
        self._abort()
        await asyncio.gather(*self._tasks)

    def __enter__(self) -> Self:
        """Listen."""
        self._thread.start()
        self._server = asyncio.run_coroutine_threadsafe(self._listen(), self._loop).result()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Break all connections, and end."""
        asyncio.run_coroutine_threadsafe(self._close(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
