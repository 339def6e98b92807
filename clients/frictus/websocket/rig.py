"""One rig over the WebSocket: watch it, take it, make it feel like something."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from typing import Any, Final, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from frictus.errors import (
    ArgumentError,
    LinkError,
    OutcomeUnknownError,
    RefusedError,
    SilenceError,
    explain,
)
from frictus.keys import Topic, Topics
from frictus.lease import names_shared_with
from frictus.messages import Message, ModelState, RigStatus, SafetyState, SceneState
from frictus.textures import Beta, Map, Profile, Region, Scene, Slope, Spectrum, Texture
from frictus.watched_rig import BLOCK_QUEUE, BLOCKS, STATE_RING, StreamName
from frictus.websocket.feeds import AsyncFeed, CountedFeed, FingerSample, SampleChunk
from frictus.websocket.held import AsyncLease, AsyncTextureStream, ending
from frictus.websocket.messages import (
    VALUES,
    Armed,
    Asked,
    CloseStream,
    Disarmed,
    OpenStream,
    PageArmRequest,
    PageDisarmRequest,
    Point,
    SceneSet,
    SetScene,
    StreamClosed,
    StreamOpened,
)
from frictus.websocket.session import FINGERS, Session

FINGER_QUEUE: Final = 64
"""A third of a second."""
TOPICS: Final = {topic: name for name, topic in VALUES.items()}
A = TypeVar("A", bound=Message)
R = TypeVar("R", bound=BaseModel)


class AsyncRig:
    """A rig behind the API. Made by `AsyncClient.rig`; what it opened closes with its client.

    Methods that ask the rig for something raise `RefusedError` if it refuses, with codes
    ``no_rig`` and ``no_link`` among the others, and `OutcomeUnknownError` or `LinkError` if
    the connection is lost.

    Parameters
    ----------
    session : Session
        What the rigs of the connection share.
    name : str
        Name of the rig.
    timeout_s : float
        Longest wait for an answer or for a first value.
    stop : callable
        Stops the rig of a name over REST; blocks.
    """

    def __init__(
        self,
        session: Session,
        name: str,
        timeout_s: float,
        stop: Callable[[str], SafetyState],
    ) -> None:
        self.name = name
        self._session = session
        self._timeout_s = timeout_s
        self._stop = stop

    # What the rig says of itself: the newest that has arrived, up to a frame behind the answer
    # to a call of this client.

    async def status(self, until: Callable[[RigStatus], bool] | None = None) -> RigStatus:
        """Return the newest status: state, owner, fault, counters, loop timing.

        Parameters
        ----------
        until : callable or None
            Wait for the first status for which it is true.

        Raises
        ------
        SilenceError
            If there is none within the client's `timeout_s`.
        """
        return await self._newest(Topics.STATUS, RigStatus, until or (lambda _: True))

    async def scene(self) -> SceneState:
        """Return the active scene and what was made of it."""
        return await self._newest(Topics.SCENE, SceneState, lambda _: True)

    async def model(self) -> ModelState:
        """Return the active friction model and its etag."""
        return await self._newest(Topics.MODEL, ModelState, lambda _: True)

    async def _newest(self, topic: Topic, kind: type[A], holds: Callable[[A], bool]) -> A:
        with contextlib.suppress(TimeoutError), contextlib.closing(self.watch(topic)) as states:
            async with asyncio.timeout(self._timeout_s):
                async for state in states:
                    if isinstance(state, kind) and holds(state):
                        return state
        raise SilenceError(
            f"rig {self.name!r} has told no such {kind.__name__} within {self._timeout_s:g} s"
        )

    def watch(
        self, topic: Topic, *, capacity: int = STATE_RING, timeout_s: float | None = None
    ) -> AsyncFeed[Message]:
        """Follow a topic of JSON messages, its present value first where it is known.

        Of messages that come faster than the connection's `rate_hz` the newest wins.

        Parameters
        ----------
        topic : Topic
            Of `frictus.keys.Topics`: STATUS, SCENE, MODEL, FINGER, GUIDANCE, RECORDING or
            ESTIMATE.
        capacity : int
            Messages held for a slow reader; beyond, the oldest go.
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.

        Raises
        ------
        ArgumentError
            If the topic is another.
        """
        if topic not in TOPICS:
            accepted = ", ".join(known.suffix for known in TOPICS)
            raise ArgumentError(f"{topic.suffix} is not passed on: {accepted} are")
        self._session.look_at(self.name)
        name = TOPICS[topic]
        feed: AsyncFeed[Message] = self._session.feed(
            name, lambda closed: AsyncFeed(capacity, timeout_s, closed)
        )
        if name in self._session.values:
            feed.put(self._session.values[name])
        return feed

    def fingers(
        self, *, capacity: int = FINGER_QUEUE, timeout_s: float | None = None
    ) -> CountedFeed[FingerSample]:
        """Follow every state of the finger; they come some at a time, 60 times a second.

        Once a lease of this client on the rig is lost, the iteration ends with
        `LeaseLostError`; without a lease it goes on whoever drives the screen.

        Parameters
        ----------
        capacity : int
            States held for a slow reader; beyond, the oldest go and are counted as lost.
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.
        """
        self._session.look_at(self.name)
        feed: CountedFeed[FingerSample] = self._session.feed(
            FINGERS, lambda closed: CountedFeed(capacity, timeout_s, closed)
        )
        self._session.follow_lease(self.name, feed)
        return feed

    def blocks(
        self,
        stream: StreamName,
        *,
        capacity: int = BLOCK_QUEUE,
        timeout_s: float | None = None,
    ) -> CountedFeed[SampleChunk]:
        """Follow a stream of samples in order; what is missing is counted in `lost`.

        It goes on after a lost lease: it shows how the output ramps to zero.

        Parameters
        ----------
        stream : {'force', 'accel', 'voltage', 'truth', 'aux', 'render'}
            N, m/s^2, V, what only a simulated rig knows, further channels, or what the rig
            renders, which comes a lead before it plays.
        capacity : int
            Items held for a slow reader, `rate_hz` a second; beyond, the oldest go and are
            counted as lost.
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.

        Raises
        ------
        ArgumentError
            If there is no such stream.
        """
        if stream not in BLOCKS:
            raise ArgumentError(f"no stream {stream!r}: {', '.join(BLOCKS)} accepted")
        self._session.look_at(self.name)
        feed: CountedFeed[SampleChunk] = self._session.feed(
            stream, lambda closed: CountedFeed(capacity, timeout_s, closed)
        )
        return feed

    # What one may ask of the rig

    @contextlib.asynccontextmanager
    async def arm(
        self,
        lease_ms: int = 3_000,
        share_with: Sequence[str] = (),
        *,
        keep_model: bool = False,
    ) -> AsyncIterator[AsyncLease]:
        """Take the rig and let it drive the screen within ``async with``.

        Parameters
        ----------
        lease_ms : int
            How long the service goes on without hearing from us, 500 to 10000 ms.
        share_with : sequence of str
            Names of at most 16 others who may change scene, stream and excitation meanwhile.
        keep_model : bool
            Whether no tracker may adapt the model until the lease ends: for trials.
        """
        lease = AsyncLease()
        asked = self._asked(
            PageArmRequest,
            share_with=names_shared_with(share_with),
            lease_ms=lease_ms,
            keep_model=keep_model,
        )
        leases = self._session.leases
        if self.name in leases and not leases[self.name].lost:
            raise RefusedError("conflict", f"this client holds rig {self.name!r} already")
        leases[self.name] = lease  # before it is asked for: no loss comes in between
        try:
            async with self._undoing(self._asked(PageDisarmRequest)):
                await self._ask(asked, Armed)
            async with ending(lambda: self._disarm(lease)):
                yield lease
        finally:
            if leases.get(self.name) is lease:
                del leases[self.name]

    @contextlib.asynccontextmanager
    async def _undoing(self, undo: Asked) -> AsyncIterator[None]:
        """Take a request back that may be carried out though nobody has the answer."""
        try:
            yield
        except (OutcomeUnknownError, asyncio.CancelledError):
            with contextlib.suppress(LinkError):
                await self._session.connection.say(undo)
            raise

    async def _disarm(self, lease: AsyncLease) -> None:
        if lease.lost:
            return
        try:
            await self._ask(self._asked(PageDisarmRequest), Disarmed)
        except RefusedError as error:
            if error.code != "not_owner":  # it was lost meanwhile
                raise

    async def set_scene(
        self,
        scene: Scene | Texture,
        if_match: str | None = None,
        *,
        timeout_s: float | None = None,
    ) -> SceneState:
        """Replace what the screen feels like, with a cross-fade.

        Parameters
        ----------
        scene : Scene or Texture
            A lone texture covers the whole screen. At most 64 kB as JSON.
        if_match : str or None
            Etag that the present scene must have; refused with code ``conflict`` otherwise.
        timeout_s : float or None
            Longest wait for the answer; None is the client's.

        Returns
        -------
        SceneState
            The scene with its etag, and in `applied` the gain and bias that the rig could
            apply; below a gain of 1 the scene was scaled.
        """
        if isinstance(scene, Spectrum | Profile | Beta | Slope | Map):
            scene = Scene(regions=[Region(texture=scene)])
        asked = self._asked(SetScene, scene=scene, if_match=if_match)
        async with self._session.calls:
            answer = await self._ask(asked, SceneSet, timeout_s)
        return SceneState(etag=answer.etag, scene=scene, applied=answer.applied)

    @contextlib.asynccontextmanager
    async def open_stream(self, peak_n: float) -> AsyncIterator[AsyncTextureStream]:
        """Stream textures within ``async with``; one at a time over a connection.

        The rig must be armed by this client, or shared with it.

        Parameters
        ----------
        peak_n : float
            Largest |friction| that will be sent, above 0 and up to 10 N, also less its mean,
            which the rig takes off. It fixes bias and gain until the stream ends.
        """
        session = self._session
        asked = self._asked(OpenStream, peak_n=float(peak_n))

        streams: list[AsyncTextureStream] = []

        def take(opened: StreamOpened) -> None:
            session.refusals.pop("update", None)
            session.stream = AsyncTextureStream(
                session.connection, opened, asked.peak_n, session.refusals
            )
            session.follow_lease(self.name, session.stream)
            streams.append(session.stream)

        async with session.calls, self._undoing(self._closing()):
            await session.connection.ask(asked, StreamOpened, self._timeout_s, take)
        [stream] = streams
        async with ending(lambda: self._close_stream(stream)):
            yield stream

    async def _close_stream(self, stream: AsyncTextureStream) -> None:
        stream.closed()
        if self._session.stream is not stream:
            return  # it has ended before
        self._session.stream = None
        try:
            async with self._session.calls:
                stream.updates = await self._ask(self._closing(), StreamClosed)
        except RefusedError as error:
            if error.code != "no_stream":  # it ended meanwhile
                raise

    def _closing(self) -> CloseStream:
        return CloseStream(op="close_stream", id=self._session.connection.next_id())

    async def stop(self) -> SafetyState:
        """Ramp the output to zero now, whoever owns the rig; return the state after it.

        It goes by REST, which waits for nothing else, and needs no more than the scope `read`.
        """
        return await asyncio.to_thread(self._stop, self.name)

    async def point(
        self, x_mm: float, y_mm: float, *, in_contact: bool = True, normal_force_n: float = 0.4
    ) -> None:
        """Move the virtual finger of a simulated rig whose finger is set to `client`.

        A refusal comes later than its point: the next one raises it.

        Parameters
        ----------
        x_mm, y_mm : float
            Position on the screen.
        in_contact : bool
            Whether it touches.
        normal_force_n : float
            How hard it presses, 0 to 5 N.
        """
        self._session.look_at(self.name)
        refused = self._session.refusals.pop("point", None)
        if refused is not None:
            raise refused
        place = {"x_mm": float(x_mm), "y_mm": float(y_mm)}
        with _checked():
            point = Point(
                op="point", **place, in_contact=in_contact, normal_force_n=float(normal_force_n)
            )
        if "status" not in self._session.values:
            await self.status()  # the service moves the finger of a rig that it knows
        await self._session.connection.say(point)

    def _asked(self, kind: type[R], **fields: Any) -> R:
        """Return a request to this rig; a wrong one would end the connection."""
        op = get_args(kind.model_fields["op"].annotation)[0]
        with _checked():
            return kind(op=op, rig=self.name, id=self._session.connection.next_id(), **fields)

    async def _ask(self, asked: Asked, answer: type[A], timeout_s: float | None = None) -> A:
        wait_s = self._timeout_s if timeout_s is None else timeout_s
        return await self._session.connection.ask(asked, answer, wait_s)


@contextlib.contextmanager
def _checked() -> Iterator[None]:
    try:
        yield
    except ValidationError as error:
        raise ArgumentError(explain(error)) from None
