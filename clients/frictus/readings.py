"""What one rig says of itself."""

import threading
from collections.abc import Callable, Iterable
from typing import Any, TypeVar, cast

import zenoh

from frictus.calls import link_loss, require_present
from frictus.closing import Held
from frictus.errors import LinkError, OutdatedStateError, SilenceError
from frictus.keys import RigKeys, Topic, Topics
from frictus.lease import expect_state
from frictus.mailbox import Arrival
from frictus.messages import Message, ModelState, RecordingState, Reply, RigStatus, SceneState
from frictus.reception import Declare, Declared, Latest, OnSample
from frictus.session import declare_reader

M = TypeVar("M", bound=Message)


class Readings:
    """Reads one rig. Several clients of one session may share it, from any thread.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    keys : RigKeys
        The rig.
    timeout_s : float
        Longest wait for a first value, and for what the rig has confirmed.
    """

    def __init__(self, session: zenoh.Session, keys: RigKeys, timeout_s: float) -> None:
        self._session = session
        self._keys = keys
        self._timeout_s = timeout_s
        self._opening = threading.Lock()
        self._latest: dict[str, Latest[Any]] = {}
        self._presence: Latest[bool] | None = None
        self._held = Held()

    def value(self, topic: Topic, kind: type[M]) -> M:
        """Return the newest value of a topic; wait for the first, and for what is expected.

        Parameters
        ----------
        topic : Topic
            Its row in the table of keys.
        kind : type
            Its messages.

        Raises
        ------
        NoRigError
            If the rig is not present, or is gone since: what it said last holds no more.
        OutdatedStateError
            If the rig is there, but has not published what it confirmed.
        LinkError
            If it is there and has never published the topic; or without a link, over which
            nothing newer could have come.
        """
        if not self._session.info.transports():
            raise LinkError(f"{topic.suffix} is not known: {link_loss(self._session)}")
        latest = self.latest(topic, kind)
        if self._presence is not None and self._presence.newest() is False:
            require_present(self._session, self._keys)
        try:
            return latest.value(self._timeout_s)
        except OutdatedStateError as error:
            require_present(self._session, self._keys)
            where = f"{topic.suffix} of rig {self._keys.rig}"
            raise OutdatedStateError(f"{where}: {error}") from None
        except SilenceError:
            require_present(self._session, self._keys)
            raise LinkError(
                f"rig {self._keys.rig} is present but said nothing under {topic.suffix} "
                f"within {self._timeout_s:g} s; it may be starting"
            ) from None

    def latest(self, topic: Topic, kind: type[M]) -> Latest[M]:
        """Return the reader of a topic; it receives from the first call on.

        Parameters
        ----------
        topic : Topic
            Its row in the table of keys.
        kind : type
            Its messages.
        """
        with self._opening:
            if self._presence is None:
                self._presence = self._held.keep(Latest(self._declare_presence, _is_there))
            if topic.suffix not in self._latest:
                self._latest[topic.suffix] = self._held.keep(
                    Latest(self.declare(topic), lambda arrival: kind.from_json(arrival.payload))
                )
            return self._latest[topic.suffix]

    def _declare_presence(self, callback: OnSample) -> Declared:
        liveliness = self._session.liveliness()
        try:
            return cast(Declared, liveliness.declare_subscriber(self._keys.alive, callback))
        except zenoh.ZError as error:  # the client was closed
            raise LinkError(f"rig {self._keys.rig} cannot be followed: {error}") from error

    def declare(self, topic: Topic) -> Declare:
        """Return what declares a subscriber of a topic for a given callback.

        Parameters
        ----------
        topic : Topic
            Its row in the table of keys.
        """

        def declared(callback: OnSample) -> Declared:
            try:
                return declare_reader(self._session, self._keys.of(topic), topic, callback)
            except zenoh.ZError as error:  # the client was closed
                raise LinkError(f"{topic.suffix} cannot be followed: {error}") from error

        return declared

    def expect(self, topic: Topic, kind: type[SceneState | ModelState], reply: Reply) -> None:
        """Have the next read of a topic include what a reply confirmed, or what came after.

        Parameters
        ----------
        topic : Topic
            Its row in the table of keys.
        kind : type
            Its messages.
        reply : Reply
            What the rig answered.
        """
        self.latest(topic, kind).expect(
            reply.utc_ns, self._timeout_s, lambda state: state.etag == reply.etag
        )
        self.expect_status(reply)

    def expect_status(self, reply: Reply) -> None:
        """Have the next status read include what a reply confirmed.

        Parameters
        ----------
        reply : Reply
            What the rig answered.
        """
        expect_state(self.latest(Topics.STATUS, RigStatus), reply, self._timeout_s)

    def recorder_at(
        self, states: Iterable[Message], holds: Callable[[RecordingState], bool]
    ) -> RecordingState:
        """Return the recorder's first state that holds; the next read includes it.

        Parameters
        ----------
        states : iterable of Message
            The recorder's, from before it was asked.
        holds : callable
            Whether it has done what was asked.

        Raises
        ------
        OutdatedStateError
            If it says nothing more.
        LinkError
            If the client was closed meanwhile.
        """
        try:
            for state in states:
                if isinstance(state, RecordingState) and holds(state):
                    break
            else:
                raise LinkError("the client was closed while it waited for the recorder")
        except SilenceError:
            raise OutdatedStateError(
                f"the recorder of rig {self._keys.rig} has done it, but says nothing since"
            ) from None
        self.latest(Topics.RECORDING, RecordingState).expect(state.utc_ns, self._timeout_s)
        return state

    def close(self) -> None:
        """Stop receiving. Closing twice is harmless."""
        with self._opening:
            self._latest.clear()
            self._presence = None
            self._held.close()


def _is_there(arrival: Arrival) -> bool:
    return not arrival.deleted
