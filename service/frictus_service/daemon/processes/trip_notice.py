"""What is said under a rig's name while its process is gone."""

import time
from collections import deque

import zenoh
from zenoh.handlers import Callback

from frictus.errors import FrameError
from frictus.keys import RigKeys, Topics
from frictus.messages import Fault, RigStatus
from frictus.session import declare_latest_publisher
from frictus_service.daemon.safety import ACTIONS


class TripNotice:
    """The status of a rig that has died: its last one, tripped, with the reason.

    Parameters
    ----------
    session : zenoh.Session
        Of the supervisor; listened on from now on.
    keys : RigKeys
        Of the rig.
    """

    def __init__(self, session: zenoh.Session, keys: RigKeys) -> None:
        self._session = session
        self._key = keys.of(Topics.STATUS)
        self._last: deque[bytes] = deque(maxlen=1)
        self._publisher: zenoh.ext.AdvancedPublisher | None = None

        def note(sample: zenoh.Sample) -> None:
            self._last.append(sample.payload.to_bytes())

        self._subscriber = session.declare_subscriber(self._key, Callback(note, indirect=False))

    def tell(self, reason: str) -> None:
        """Publish that the rig has tripped; nothing if it never was present.

        Parameters
        ----------
        reason : str
            How its process ended and what came of the device.

        Raises
        ------
        zenoh.ZError, LinkError
            If it cannot be published.
        """
        if not self._last:
            return
        try:
            last = RigStatus.from_json(self._last[-1])
        except FrameError:
            return  # somebody else's bytes under the rig's key
        now_ns = time.time_ns()
        fault = Fault(kind="internal", reason=reason, utc_ns=now_ns, action=ACTIONS["internal"])
        status = last.model_copy(
            update={
                "utc_ns": now_ns,
                "state": "tripped",
                "fault": fault,
                "owner": None,
                "stream_open": False,
            }
        )
        if self._publisher is None:
            self._publisher = declare_latest_publisher(self._session, self._key, Topics.STATUS)
        self._publisher.put(status.to_json())

    def withdraw(self) -> None:
        """Say nothing any more: the rig speaks for itself."""
        if self._publisher is not None:
            self._publisher.undeclare()  # type: ignore[no-untyped-call]
            self._publisher = None

    def close(self) -> None:
        """Listen to the rig no longer."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
