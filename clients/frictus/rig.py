"""One rig, as its clients see it: watch it, take it, make it feel like something."""

import contextlib
import time
from collections.abc import Callable, Sequence

import zenoh
from pydantic import ValidationError

from frictus.calls import Caller
from frictus.errors import ArgumentError, LinkError, explain
from frictus.keys import RigKeys, Topics
from frictus.lease import Lease
from frictus.messages import (
    AdaptationPolicy,
    Applied,
    Excitation,
    ModelState,
    PointerState,
    RecordingState,
    RigStatus,
    SafetyState,
    SceneState,
)
from frictus.model import Compensation, CompensationMode, Model
from frictus.readings import Readings
from frictus.session import declare_publisher
from frictus.stream import TextureStream
from frictus.textures import Beta, Map, Profile, Region, Scene, Slope, Spectrum, Texture
from frictus.watched_rig import WatchedRig


class Rig(WatchedRig):
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
        super().__init__(session, keys, timeout_s, readings)
        self._caller = Caller(session, keys, client, timeout_s)
        self._pointer: zenoh.Publisher | None = None

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
        still_there: Callable[[], bool] = lambda: True,
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
        still_there : callable
            Whether whom we hold it for is there, asked by a thread: else nothing is renewed.
        """
        status = self._readings.latest(Topics.STATUS, RigStatus)
        fail = self._leases.fail_followers
        return self._leases.hold(
            Lease(self._caller, status, lease_ms, fail, share_with, keep_model, still_there)
        )

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
            Largest |friction| that will be sent, above 0 and up to 10 N, also less its mean,
            which the rig takes off.
        """
        status = self._readings.latest(Topics.STATUS, RigStatus)
        return self._leases.follow(self._held.keep(TextureStream(self._caller, status, peak_n)))

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
            1 to 100 letters, digits, ``-``, ``_`` and ``.``; refused with code `conflict` where
            it is taken, or while another recording is under way.
        participant, notes : str
            Pseudonym of at most 64 characters that show, or None, and text; both are kept.

        Returns
        -------
        RecordingState
            With the path on the recorder's machine.
        """
        old = self.recording()  # of one of this name, perhaps, whose file is gone
        with self.watch(Topics.RECORDING, timeout_s=self._timeout_s) as states:
            self._caller.call("record", name=name, participant=participant, notes=notes)
            return self._readings.recorder_at(states, lambda it: it.name == name and it != old)

    def end_recording(self) -> RecordingState:
        """End the recording; return how long it became and what was lost in it."""
        with self.watch(Topics.RECORDING, timeout_s=self._timeout_s) as states:
            self._caller.call("end_recording")
            return self._readings.recorder_at(states, lambda state: not state.recording)

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
        try:
            state = PointerState(
                client=self._caller.client,
                utc_ns=time.time_ns(),
                x_mm=x_mm,
                y_mm=y_mm,
                in_contact=in_contact,
                normal_force_n=normal_force_n,
            )
        except ValidationError as error:
            raise ArgumentError(f"point: {explain(error)}") from error
        try:
            if self._pointer is None:
                key = self.keys.of(Topics.POINTER)
                self._pointer = declare_publisher(self._session, key, Topics.POINTER)
            self._pointer.put(state.to_json(), attachment=self._caller.client)
        except zenoh.ZError as error:  # the client was closed
            raise LinkError(f"the point was not sent: {error}") from error

    def close(self) -> None:
        """Disarm if armed, end every feed and stream. Closing twice is harmless."""
        super().close()
        pointer, self._pointer = self._pointer, None
        if pointer is not None:
            with contextlib.suppress(zenoh.ZError):  # the session went first
                pointer.undeclare()  # type: ignore[no-untyped-call]
