"""What is rendered: the standing scene, or a stream or an excitation over it."""

import itertools
import math
import secrets
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from frictus.errors import ArgumentError, RefusedError, TextureError
from frictus.messages import (
    CloseStreamRequest,
    CompensationRequest,
    ExciteRequest,
    OpenStreamRequest,
    Reply,
    SceneRequest,
    SceneState,
)
from frictus.model import BY_MODEL, Compensation
from frictus.stream import StreamFrame
from frictus.textures import Scene
from frictus_hardware.physics.screen import Screen
from frictus_service.command_validation import check_match
from frictus_service.daemon.control import Interlock
from frictus_service.daemon.inboxes import CompensationUpdate, LoopInbox, SceneUpdate
from frictus_service.daemon.safety import refusal_to_render
from frictus_service.json_text import etag_of_scene
from frictus_service.synthesis.compensation import Inverse, inverse_in_mode
from frictus_service.synthesis.scene import (
    MAX_SCENE_BYTES,
    CompiledScene,
    StreamBudget,
    compile_excitation,
    compile_scene,
)

CACHED_SCENES: Final = 4
"""The newest scenes as compiled, by etag: so many, and of no more bytes than the largest."""


@dataclass(slots=True)
class _Stream:
    client: str
    ticket: int
    arming: int
    budget: StreamBudget
    sequence: int = -1
    frame: StreamFrame | None = None
    """The newest, which is felt until `until_s`."""
    until_s: float = math.inf


@dataclass(frozen=True, slots=True)
class _Guest:
    """What is played instead of the standing scene until its arming ends."""

    arming: int
    state: SceneState


@dataclass(frozen=True, slots=True)
class _ChosenCompensation:
    """How the model is inverted until its arming ends."""

    arming: int
    compensation: Compensation


@dataclass(frozen=True, slots=True)
class CompiledFor:
    """What is rendered, compiled for a model that is to come into force.

    Attributes
    ----------
    state : SceneState
        The standing scene, with what becomes of it.
    compiled : CompiledScene
        The same for the loop.
    stream, update : optional
        The open stream with its new budget, and its newest update for the loop.
    """

    state: SceneState
    compiled: CompiledScene
    stream: _Stream | None = None
    update: SceneUpdate | None = None


class SceneController:
    """Compiles what clients ask for and orders the loop to play it. Used by one thread.

    The properties may be read by any.

    Parameters
    ----------
    screen : Screen
        Its peak voltage, carrier and size.
    sample_rate_hz : float
        Samples per second of the device's clock.
    interlock : Interlock
        Holds the safety state.
    orders : LoopInbox
        With the model to begin with.
    monotonic_s : callable
        Monotonic clock, s.
    """

    def __init__(
        self,
        screen: Screen,
        sample_rate_hz: float,
        interlock: Interlock,
        orders: LoopInbox,
        monotonic_s: Callable[[], float],
    ) -> None:
        self._screen = screen
        self._rate_hz = sample_rate_hz
        self._interlock = interlock
        self._orders = orders
        self._monotonic_s = monotonic_s
        self._stream: _Stream | None = None
        self._cache: dict[str, tuple[Inverse, SceneState, CompiledScene]] = {}
        self._tickets = itertools.count(secrets.randbits(31))
        self._standing, self._standing_scene = self._compiled(Scene(), self._inverse)
        self._guest: _Guest | None = None
        self._chosen: _ChosenCompensation | None = None
        self.scaled_scenes = 0
        self.updates = 0
        orders.stand(self._standing_scene)

    @property
    def stream_open(self) -> bool:
        """Whether a stream is open; it ends with its owner's lease."""
        return self._live_stream() is not None

    @property
    def scene(self) -> SceneState:
        """What is rendered."""
        guest = self._guest
        if guest is None or not self._holds(guest.arming):
            return self._standing
        return guest.state

    @property
    def compensation(self) -> Compensation:
        """The mode in force: what was chosen in this arming, else `model`."""
        chosen = self._chosen
        if chosen is None or not self._holds(chosen.arming):
            return BY_MODEL
        return chosen.compensation

    def check_owner(self, client: str) -> None:
        """Refuse a client that may not change what is rendered now.

        Raises
        ------
        RefusedError
            `not_owner`.
        """
        refused = refusal_to_render(self._interlock.state, client)
        if refused is not None:
            raise RefusedError(refused.code, refused.message)

    def check_ticket(self, ticket: int) -> None:
        """Refuse a texture update of another stream than the one that is open.

        Raises
        ------
        RefusedError
            `not_armed`; `not_owner` where the rig is not shared with its client any more.
        """
        self._stream_of(ticket)

    def set_scene(
        self, request: SceneRequest, check: Callable[[], None] = lambda: None
    ) -> Reply:
        """Replace the standing scene; ends an open stream or an excitation.

        Parameters
        ----------
        request : SceneRequest
            As a client sent it.
        check : callable
            Called now and then while it is compiled; may raise, to give up.

        Raises
        ------
        RefusedError
            `not_owner`, `conflict` or `not_feasible`.
        """
        self.check_owner(request.client)
        check_match(request.if_match, self.scene.etag, "scene")
        try:
            state, compiled = self._compiled(request.scene, self._inverse, check)
        except TextureError as error:
            raise RefusedError("not_feasible", str(error)) from error
        self.check_owner(request.client)  # compiling may have outlasted the lease
        self._stream = self._guest = None
        self._standing, self._standing_scene = state, compiled
        self._orders.stand(compiled)
        self.scaled_scenes += state.applied.scaled
        return Reply(ok=True, etag=state.etag, applied=state.applied)

    def open_stream(self, request: OpenStreamRequest) -> Reply:
        """Announce a streamed texture; only the owner of an armed rig may.

        Raises
        ------
        RefusedError
            `not_owner`, `not_armed` or `not_feasible`.
        """
        arming = self._arming_of(request.client)
        try:
            budget = StreamBudget.open(request.peak_n, self._inverse)
        except TextureError as error:
            raise RefusedError("not_feasible", str(error)) from error
        ticket = next(self._tickets) & 0x7FFFFFFF
        state = SceneState(
            etag=f"stream-{ticket}",
            scene=Scene(name=f"streamed by {request.client}"),
            applied=budget.applied,
            source="stream",
        )
        self._guest = _Guest(arming, state)
        self._stream = _Stream(request.client, ticket, arming, budget)
        quiet = budget.quiet
        self._orders.scene.append(SceneUpdate(quiet, afterwards=quiet, arming=arming))
        self.scaled_scenes += budget.applied.scaled
        return Reply(ok=True, ticket=ticket, applied=state.applied, etag=state.etag)

    def excite(self, request: ExciteRequest) -> Reply:
        """Play an excitation; only for the owner of an armed rig, until its lease ends.

        Raises
        ------
        RefusedError
            `not_owner`, `not_armed` or `not_feasible`.
        """
        arming = self._arming_of(request.client)
        try:
            compiled = compile_excitation(request.excitation, self._inverse.law, self._rate_hz)
        except ArgumentError as error:
            raise RefusedError("not_feasible", str(error)) from error
        state = SceneState(
            etag=etag_of_scene(request.excitation),
            scene=Scene(name=f"excitation by {request.client}"),
            applied=compiled.applied,
            source="excitation",
            excitation=request.excitation,
        )
        self._stream, self._guest = None, _Guest(arming, state)
        self._orders.scene.append(SceneUpdate(compiled, arming=arming))
        return Reply(ok=True, etag=state.etag, applied=state.applied)

    def close_stream(self, request: CloseStreamRequest) -> Reply:
        """End the stream and fade to the standing scene; harmless where it is not open.

        Raises
        ------
        RefusedError
            `not_owner`.
        """
        self.check_owner(request.client)
        if self._stream is not None and request.ticket in (None, self._stream.ticket):
            self._stream = self._guest = None
            self._orders.scene.append(SceneUpdate(self._standing_scene))
        return Reply(ok=True, etag=self._standing.etag)

    def update(self, frame: StreamFrame, good_for_s: float) -> None:
        """Play an update of the stream.

        Parameters
        ----------
        frame : StreamFrame
            As a client sent it.
        good_for_s : float
            If no other update follows within this time, the texture fades away.

        Raises
        ------
        RefusedError
            `not_armed` without a stream of this ticket, `not_owner` where the rig is not
            shared with its client any more, `stale` if a newer update came first,
            `not_feasible` if it exceeds what the stream declared.
        """
        until_s = self._monotonic_s() + good_for_s
        stream = self._stream_of(frame.ticket)
        if frame.sequence <= stream.sequence:
            raise RefusedError("stale", f"update {stream.sequence} came before")
        try:
            compiled = stream.budget.compile(frame)
        except TextureError as error:
            raise RefusedError("not_feasible", str(error)) from error
        stream.sequence, stream.frame, stream.until_s = frame.sequence, frame, until_s
        quiet = stream.budget.quiet
        self._orders.scene.append(SceneUpdate(compiled, until_s, quiet, stream.arming))
        self.updates += 1

    def compensate(self, request: CompensationRequest) -> Reply:
        """Choose the compensation mode until the lease ends; for the owner of an armed rig.

        Raises
        ------
        RefusedError
            `not_owner`, `not_armed` or `not_feasible`.
        """
        arming, asked = self._arming_of(request.client), request.compensation
        try:
            inverse = inverse_in_mode(self._inverse, asked)
        except ArgumentError as error:
            raise RefusedError("not_feasible", str(error)) from error
        if self._arming_of(request.client) != arming:  # the lease may have ended meanwhile
            raise RefusedError("not_armed", "the lease has ended; arm again")
        self._chosen = _ChosenCompensation(arming, asked)
        self._orders.compensation.append(CompensationUpdate(inverse, arming))
        return Reply(ok=True, compensation=self.compensation)

    def compiled_for(self, inverse: Inverse) -> CompiledFor:
        """Compile what is rendered for another model, its stream with the same peak.

        Parameters
        ----------
        inverse : Inverse
            Of the model.

        Raises
        ------
        TextureError
            If something cannot be rendered with it.
        """
        state, compiled = self._compiled(self._standing.scene, inverse)
        stream = self._live_stream()
        if stream is None:
            return CompiledFor(state, compiled)
        budget = StreamBudget.open(stream.budget.peak_n, inverse)
        newest = budget.quiet if stream.frame is None else budget.compile(stream.frame)
        update = SceneUpdate(newest, stream.until_s, budget.quiet, stream.arming)
        return CompiledFor(state, compiled, replace(stream, budget=budget), update)

    def keep(self, scenes: CompiledFor) -> None:
        """Go on with what was compiled for a model that has come into force.

        Parameters
        ----------
        scenes : CompiledFor
            Of `compiled_for`, with no other call between.
        """
        self._standing, self._standing_scene = scenes.state, scenes.compiled
        if scenes.stream is not None and self._guest is not None:
            applied = {"applied": scenes.stream.budget.applied}
            self._stream = scenes.stream
            self._guest = replace(
                self._guest, state=self._guest.state.model_copy(update=applied)
            )

    @property
    def _inverse(self) -> Inverse:
        return self._orders.model.in_force.inverse

    def _live_stream(self) -> _Stream | None:
        stream = self._stream
        return stream if stream is not None and self._holds(stream.arming) else None

    def _stream_of(self, ticket: int) -> _Stream:
        stream = self._live_stream()
        if stream is None or stream.ticket != ticket:
            raise RefusedError("not_armed", f"no stream with ticket {ticket} is open")
        self.check_owner(stream.client)  # the rig may be shared with others by now
        return stream

    def _holds(self, arming: int) -> bool:
        safety = self._interlock.state
        return safety.state == "armed" and safety.armings == arming

    def _arming_of(self, client: str) -> int:
        """Return the present arming, which must be this client's."""
        refused = refusal_to_render(safety := self._interlock.state, client)
        if refused is not None:
            raise RefusedError(refused.code, refused.message)
        if safety.state != "armed":
            raise RefusedError("not_armed", "arm the rig before anything is played on it")
        return safety.armings

    def _compiled(
        self, scene: Scene, inverse: Inverse, check: Callable[[], None] = lambda: None
    ) -> tuple[SceneState, CompiledScene]:
        etag = etag_of_scene(scene)
        kept = self._cache.pop(etag, None)
        if kept is None or kept[0] is not inverse:
            compiled = compile_scene(scene, inverse, self._screen, self._rate_hz, check)
            state = SceneState(etag=etag, scene=scene, applied=compiled.applied)
            kept = inverse, state, compiled
        self._cache[etag] = kept  # the newest last
        while len(self._cache) > CACHED_SCENES or (
            len(self._cache) > 1
            and sum(scene.size_bytes for _, _, scene in self._cache.values()) > MAX_SCENE_BYTES
        ):
            del self._cache[next(iter(self._cache))]
        return kept[1:]
