"""One rig, as its clients see it: watch it, take it, make it feel like something."""

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import Any, Final, Literal, TypeVar

import zenoh

from frictus.calls import Caller, no_recorder, present_rigs
from frictus.errors import (
    ArgumentError,
    LeaseLostError,
    LinkError,
    OutdatedStateError,
    SilenceError,
)
from frictus.gaps import BlockFeed
from frictus.keys import STREAMS, RigKeys, Topic, Topics
from frictus.lease import Lease
from frictus.mailbox import Arrival
from frictus.messages import (
    MESSAGES,
    AdaptationPolicy,
    Applied,
    EstimateState,
    Excitation,
    FingerState,
    GuidanceState,
    Message,
    ModelState,
    PointerState,
    RecordingState,
    RigStatus,
    SafetyState,
    SceneState,
    TimeState,
    TouchState,
)
from frictus.model import Compensation, CompensationMode, Model
from frictus.readings import Held, Readings, close_all
from frictus.reception import Feed
from frictus.session import declare_publisher
from frictus.stream import TextureStream
from frictus.textures import Beta, Map, Profile, Region, Scene, Slope, Spectrum, Texture

StreamName = Literal["force", "accel", "voltage", "truth", "aux", "render"]
M = TypeVar("M", bound=Message)
F = TypeVar("F", bound=TextureStream | Feed[Any])

FINGER_RING: Final = 4
STATE_RING: Final = 64
TOUCH_QUEUE: Final = 512
BLOCK_QUEUE: Final = 1024  # 5 s of 5 ms blocks
BLOCKS: Final[dict[str, Topic]] = {
    topic.suffix.removeprefix("stream/"): topic for topic in STREAMS.values()
}


class Rig:
    """A rig on the network. Made by `Client.rig`; closed with its client.

    Methods that ask the rig for something raise `RefusedError` if it refuses, `NoRigError` if
    it is not present and `LinkError` if it does not answer. They block for a network round
    trip: in async code use ``await asyncio.to_thread(rig.set_scene, scene)``.

    Parameters
    ----------
    session : zenoh.Session
        The client's session.
    keys : RigKeys
        Site and name.
    client : str
        The client's name.
    timeout_s : float
        Longest wait for a reply or for a first value.
    readings : Readings or None
        What the rig says of itself, where another `Rig` reads it already and closes it.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: RigKeys,
        client: str,
        timeout_s: float,
        readings: Readings | None = None,
    ) -> None:
        self.keys = keys
        self._session = session
        self._timeout_s = timeout_s
        self._caller = Caller(session, keys, client, timeout_s)
        self._held = Held()
        self._shared = readings is not None
        self._readings = readings or Readings(session, keys, timeout_s)
        self._followers: list[TextureStream | Feed[Any]] = []
        self._leases: list[Lease] = []
        self._pointer: zenoh.Publisher | None = None

    @property
    def name(self) -> str:
        """Name of the rig."""
        return self.keys.rig

    @property
    def site(self) -> str:
        """Site of the rig."""
        return self.keys.site

    @property
    def present(self) -> bool:
        """Whether the rig's liveliness token stands; raises `LinkError` without a router."""
        return self.keys in present_rigs(self._session, self.site, self._timeout_s)

    # What the rig says of itself. After a call of this client it includes what that changed.

    def status(self) -> RigStatus:
        """Return the newest status: state, owner, fault, counters, loop timing."""
        return self._readings.value(Topics.STATUS, RigStatus)

    def scene(self) -> SceneState:
        """Return the active scene and what was made of it."""
        return self._readings.value(Topics.SCENE, SceneState)

    def model(self) -> ModelState:
        """Return the active friction model and its etag."""
        return self._readings.value(Topics.MODEL, ModelState)

    def time(self) -> TimeState:
        """Return the fit of the device's sample counter to UTC."""
        return self._readings.value(Topics.TIME, TimeState)

    def recording(self) -> RecordingState:
        """Return what the rig's recorder does; `LinkError` where none runs."""
        try:
            latest = self._readings.latest(Topics.RECORDING, RecordingState)
            return latest.value(self._timeout_s)
        except SilenceError:
            raise LinkError(no_recorder(self.keys)) from None

    def estimate(self) -> EstimateState:
        """Return what `frictus track` knows of the finger now; `LinkError` where none runs."""
        try:
            return self._readings.latest(Topics.ESTIMATE, EstimateState).value(self._timeout_s)
        except SilenceError:
            raise LinkError(
                f"nobody estimates the finger on rig {self.name}: start `frictus track`"
            ) from None

    def watch(
        self, topic: Topic, *, capacity: int = STATE_RING, timeout_s: float | None = None
    ) -> Feed[Message]:
        """Follow any topic of JSON messages, its present value first where it is cached.

        Parameters
        ----------
        topic : Topic
            A member of `frictus.keys.Topics` with JSON messages.
        capacity : int
            Messages held for a slow reader; beyond, the oldest go.
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.

        Raises
        ------
        ArgumentError
            If the topic does not carry JSON.
        """
        if topic.message not in MESSAGES:
            raise ArgumentError(f"{topic.suffix} carries {topic.message}, which is not JSON")
        kind = MESSAGES[topic.message]
        return self._feed(topic, kind, capacity, timeout_s)

    def fingers(self, *, timeout_s: float | None = None) -> Feed[FingerState]:
        """Follow the finger; a slow reader gets the newest few states, older ones go.

        Once a lease of this client on the rig is lost, the iteration ends with
        `LeaseLostError`; without a lease it goes on whoever drives the screen.

        Parameters
        ----------
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.
        """
        feed = self._feed(Topics.FINGER, FingerState, FINGER_RING, timeout_s)
        return self._following_lease(feed)

    def touches(self, *, timeout_s: float | None = None) -> Feed[TouchState]:
        """Follow the touch sensor's reports as they come; a lost lease ends it as `fingers`.

        Parameters
        ----------
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.
        """
        feed = self._feed(Topics.TOUCH, TouchState, TOUCH_QUEUE, timeout_s)
        return self._following_lease(feed)

    def guidance(self, *, timeout_s: float | None = None) -> Feed[GuidanceState]:
        """Follow what a participant is asked to do while somebody calibrates on this rig.

        Parameters
        ----------
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.
        """
        return self._feed(Topics.GUIDANCE, GuidanceState, FINGER_RING, timeout_s)

    def _feed(
        self, topic: Topic, kind: type[M], capacity: int, timeout_s: float | None
    ) -> Feed[M]:
        def decode(arrival: Arrival) -> list[M]:
            return [kind.from_json(arrival.payload)]

        return self._held.keep(Feed(self._readings.declare(topic), decode, capacity, timeout_s))

    def blocks(
        self,
        stream: StreamName,
        *,
        capacity: int = BLOCK_QUEUE,
        timeout_s: float | None = None,
    ) -> BlockFeed:
        """Follow a stream of samples in order, with a `Gap` wherever something is missing.

        It goes on after a lost lease: it shows how the output ramps to zero.

        Parameters
        ----------
        stream : {'force', 'accel', 'voltage', 'truth', 'aux', 'render'}
            N, m/s^2, V, what only a simulated rig knows, further channels, or what the rig
            renders, which comes a lead before it plays; see `frictus.keys.Topics`.
        capacity : int
            Blocks held for a slow reader; beyond, the oldest go and show as a `Gap`.
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.

        Raises
        ------
        ArgumentError
            If there is no such stream.
        """
        if stream not in BLOCKS:
            raise ArgumentError(f"no stream {stream!r}: {', '.join(BLOCKS)} accepted")
        topic = BLOCKS[stream]
        declare = self._readings.declare(topic)
        return self._held.keep(BlockFeed(declare, topic, capacity, timeout_s))

    # What one may ask of the rig

    def on_behalf_of(self, client: str) -> "Rig":
        """Return this rig as another client commands it, over the same session.

        For a service that speaks for several people: to the rig each of them is a client. Both
        read the same states, so that what one changes the other sees. Close it before this one.

        Parameters
        ----------
        client : str
            Name of that client.
        """
        return Rig(self._session, self.keys, client, self._timeout_s, self._readings)

    def arm(
        self,
        lease_ms: int = 500,
        share_with: Sequence[str] = (),
        *,
        keep_model: bool = False,
    ) -> Lease:
        """Take the rig and let it drive the screen; use it in ``with``.

        Parameters
        ----------
        lease_ms : int
            How long the rig goes on without hearing from us, 100 to 10000 ms.
        share_with : sequence of str
            Names of at most 16 others who may change scene, stream and excitation meanwhile:
            clients, or people of the API by the name of their token.
        keep_model : bool
            Whether no tracker may adapt the model until the lease ends: for trials.
        """
        status = self._readings.latest(Topics.STATUS, RigStatus)
        lease = Lease(
            self._caller, status, lease_ms, self._fail_followers, share_with, keep_model
        )
        self._leases = [other for other in self._leases if not other.finished] + [lease]
        return lease

    def _following_lease(self, follower: F) -> F:
        """Return a feed or stream that fails when the lease of this client is lost."""
        self._followers = [other for other in self._followers if not other.closed] + [follower]
        for lease in self._leases:  # after it was listed: no loss falls between the two
            if lease.loss is not None and not lease.finished:
                follower.fail(lease.loss)
        return follower

    def _fail_followers(self, loss: LeaseLostError) -> None:
        for follower in self._followers:
            follower.fail(loss)

    def set_scene(
        self,
        scene: Scene | Texture,
        if_match: str | None = None,
        *,
        timeout_s: float | None = None,
    ) -> SceneState:
        """Replace what the screen feels like, with a cross-fade.

        A newer scene of the same client ends this one's compilation: it is then refused with
        code `unavailable`.

        Parameters
        ----------
        scene : Scene or Texture
            A lone texture covers the whole screen.
        if_match : str or None
            Etag that the present scene must have; refused with code `conflict` otherwise.
        timeout_s : float or None
            Longest wait for the reply, up to 60 s; None is the client's.

        Returns
        -------
        SceneState
            The scene with its etag, and in `applied` the gain and bias that the rig could
            apply; below a gain of 1 the scene was scaled.
        """
        if isinstance(scene, Spectrum | Profile | Beta | Slope | Map):
            scene = Scene(regions=[Region(texture=scene)])
        reply = self._caller.call("scene", scene=scene, if_match=if_match, timeout_s=timeout_s)
        if reply.applied is None or reply.etag is None:
            raise LinkError("the rig did not say what it applied: protocol fault")
        self._readings.expect(Topics.SCENE, SceneState, reply)
        return SceneState(
            etag=reply.etag, scene=scene, applied=reply.applied, utc_ns=reply.utc_ns
        )

    def open_stream(self, peak_n: float) -> TextureStream:
        """Open a texture stream; the rig must be armed by this client, or shared with it.

        Parameters
        ----------
        peak_n : float
            Largest |friction| that will be sent, above 0 and up to 10 N.
        """
        status = self._readings.latest(Topics.STATUS, RigStatus)
        return self._following_lease(
            self._held.keep(TextureStream(self._caller, status, peak_n))
        )

    def excite(self, excitation: Excitation) -> Applied:
        """Play a drive as it is, without the inverse of any model, for calibration.

        The rig must be armed by this client, or shared with it. It ends with the lease, with a
        scene or a stream.

        Parameters
        ----------
        excitation : Excitation
            Tones around a bias; refused with code `not_feasible` where the drive would leave
            [0, 1].

        Returns
        -------
        Applied
            The bias, and the friction that it adds by the model in force.
        """
        reply = self._caller.call("excite", excitation=excitation)
        if reply.applied is None:
            raise LinkError("the rig did not say what it applied: protocol fault")
        self._readings.expect(Topics.SCENE, SceneState, reply)
        return reply.applied

    def compensate(
        self, mode: CompensationMode, *, speed_mm_s: float | None = None
    ) -> Compensation:
        """Choose what the rig inverts, with a cross-fade of 20 ms.

        The rig must be armed by this client, or shared with it. With the lease the mode ends:
        the rig is back at `model`. Every status says which is in force.

        Parameters
        ----------
        mode : {'model', 'fixed', 'none'}
            The friction model at the finger's predicted speed; the same at `speed_mm_s`,
            however fast the finger moves; nothing.
        speed_mm_s : float or None
            For `fixed` alone: 1 to 1000 mm/s, and where the model holds; refused with code
            `not_feasible` elsewhere.

        Returns
        -------
        Compensation
            What is in force.

        Raises
        ------
        ArgumentError
            If there is no such mode, or a speed is missing, out of range or not wanted.
        RefusedError
            `not_armed`, `not_owner` or `not_feasible`.
        """
        asked = {"mode": mode, "speed_mm_s": speed_mm_s}
        reply = self._caller.call("compensation", compensation=asked)
        if reply.compensation is None:
            raise LinkError("the rig did not say what is in force: protocol fault")
        self._readings.expect_status(reply)
        return reply.compensation

    def set_model(
        self, model: Model, if_match: str | None = None, *, timeout_s: float | None = None
    ) -> str:
        """Replace the friction model, while disarmed; return its etag.

        Parameters
        ----------
        model : Model
            A `model/1` document.
        if_match : str or None
            Etag that the present model must have; refused with code `conflict` otherwise.
        timeout_s : float or None
            Longest wait for the reply, up to 60 s; None is the client's.
        """
        return self.apply_model(model, if_match, timeout_s=timeout_s)[0]

    def apply_model(
        self, model: Model, if_match: str | None = None, *, timeout_s: float | None = None
    ) -> tuple[str, str]:
        """Replace the friction model as `set_model`; return its etag and the rig's remarks.

        The remarks say for people what of the model is not rendered; they may be empty.

        Parameters
        ----------
        model : Model
            A `model/1` document.
        if_match : str or None
            As `set_model`.
        timeout_s : float or None
            As `set_model`.
        """
        reply = self._caller.call("model", model=model, if_match=if_match, timeout_s=timeout_s)
        if reply.etag is None:
            raise LinkError("the rig did not name the model's etag: protocol fault")
        self._readings.expect(Topics.MODEL, ModelState, reply)
        return reply.etag, reply.message

    def set_adaptation(
        self, policy: AdaptationPolicy, *, undo: bool = False
    ) -> AdaptationPolicy:
        """Choose what a tracker may do with the model, whoever holds the rig.

        Parameters
        ----------
        policy : {'observe', 'suggest', 'adapt'}
            Publish its estimate; also say which model it would put in force; have gain and
            cutoff of the model follow the finger while it plays. Every status says which holds.
        undo : bool
            Whether to put the model back in force that was set before it was adapted, with a
            cross-fade where it is felt.

        Returns
        -------
        str
            The policy in force.

        Raises
        ------
        ArgumentError
            If there is no such policy.
        RefusedError
            Of what is to be undone alone, and nothing is changed then: `conflict` while an
            excitation or another compensation mode plays, `not_owner` where another client
            armed the rig with `keep_model`, `tripped`.
        """
        reply = self._caller.call("adaptation", policy=policy, undo=undo)
        if reply.adaptation is None or reply.etag is None:
            raise LinkError("the rig did not say which policy is in force: protocol fault")
        self._readings.expect(Topics.MODEL, ModelState, reply)
        return reply.adaptation

    def adapt(self, model: Model, if_match: str, reason: str = "") -> str:
        """Have the rig's model follow the finger while it plays; return its etag.

        For a tracker, under the policy `adapt`; it needs no lease.

        Parameters
        ----------
        model : Model
            The model in force with another gain and cutoff.
        if_match : str
            Etag of the model in force that it was made from.
        reason : str
            For people, at most 500 characters.

        Raises
        ------
        ArgumentError
            If the reason is too long.
        RefusedError
            `conflict` under another policy, with another model in force, and while an
            excitation or another compensation mode plays; `not_owner` where the owner armed
            the rig with `keep_model`; `unavailable` within 2 s of the last change of the
            model; `not_feasible` where more than gain and cutoff differ, or they are beyond a
            factor of 4 from the model that was set; `tripped`.
        """
        reply = self._caller.call("adapt", model=model, if_match=if_match, reason=reason)
        if reply.etag is None:
            raise LinkError("the rig did not name the model's etag: protocol fault")
        self._readings.expect(Topics.MODEL, ModelState, reply)
        return reply.etag

    def record(
        self, name: str, participant: str | None = None, notes: str = ""
    ) -> RecordingState:
        """Have the rig's recorder record everything that the rig publishes.

        Parameters
        ----------
        name : str
            Of the recording: 1 to 100 letters, digits, ``-``, ``_`` and ``.``; refused with
            code `conflict` where it is taken, or while another recording is under way.
        participant : str or None
            Pseudonym, at most 64 characters.
        notes : str
            Kept in the recording.

        Returns
        -------
        RecordingState
            With the path on the recorder's machine.
        """
        with self.watch(Topics.RECORDING, timeout_s=self._timeout_s) as states:
            self._caller.call("record", name=name, participant=participant, notes=notes)
            return self._recorder_at(states, lambda state: state.name == name)

    def end_recording(self) -> RecordingState:
        """End the recording; return how long it became and what was lost in it."""
        with self.watch(Topics.RECORDING, timeout_s=self._timeout_s) as states:
            self._caller.call("end_recording")
            return self._recorder_at(states, lambda state: not state.recording)

    def _recorder_at(
        self, states: Feed[Message], holds: Callable[[RecordingState], bool]
    ) -> RecordingState:
        """Return the first state that holds; the next read includes it."""
        try:
            state = _first(states, holds)
        except SilenceError:
            raise OutdatedStateError(
                f"the recorder of rig {self.name} has done it, but says nothing since"
            ) from None
        self._readings.latest(Topics.RECORDING, RecordingState).expect(
            lambda newest: newest.utc_ns >= state.utc_ns, self._timeout_s
        )
        return state

    def stop(self) -> SafetyState:
        """Ramp the output to zero now, whoever owns the rig; return the state after it."""
        return self._command("stop")

    def reset(self) -> SafetyState:
        """Clear a latched trip, as the operator who has removed its cause; return the state."""
        return self._command("reset")

    def _command(self, name: str) -> SafetyState:
        reply = self._caller.call(name)
        self._readings.expect_status(reply)
        return reply.state

    def point(
        self, x_mm: float, y_mm: float, *, in_contact: bool = True, normal_force_n: float = 0.4
    ) -> None:
        """Move the virtual finger of a rig whose finger is set to `client` or `takeover`.

        Parameters
        ----------
        x_mm, y_mm : float
            Position on the screen.
        in_contact : bool
            Whether it touches.
        normal_force_n : float
            How hard it presses, 0 to 5 N.
        """
        if self._pointer is None:
            key = self.keys.of(Topics.POINTER)
            self._pointer = declare_publisher(self._session, key, Topics.POINTER)
        try:
            state = PointerState(
                client=self._caller.client,
                utc_ns=time.time_ns(),
                x_mm=x_mm,
                y_mm=y_mm,
                in_contact=in_contact,
                normal_force_n=normal_force_n,
            )
        except ValueError as error:
            raise ArgumentError(str(error)) from error
        self._pointer.put(state.to_json(), attachment=self._caller.client)

    def close(self) -> None:
        """Disarm if armed, end every feed and stream. Closing twice is harmless."""
        leases, self._leases = self._leases, []
        closes = [*(lease.disarm for lease in leases), self._held.close]
        if not self._shared:
            closes.append(self._readings.close)
        close_all(closes)
        pointer, self._pointer = self._pointer, None
        if pointer is not None:
            with contextlib.suppress(zenoh.ZError):  # the session went first
                pointer.undeclare()  # type: ignore[no-untyped-call]


def _first(states: Feed[Message], holds: Callable[[RecordingState], bool]) -> RecordingState:
    for state in states:
        if isinstance(state, RecordingState) and holds(state):
            return state
    raise LinkError("the client was closed while it waited for the recorder")
