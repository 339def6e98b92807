"""What is said under a rig's name while its process is gone."""

from collections import deque
from typing import Final

import zenoh
from zenoh.handlers import Callback

from frictus.errors import FrameError
from frictus.keys import RigKeys, Topics
from frictus.messages import Fault, LeaseEnd, RigStatus
from frictus.session import declare_latest_publisher
from frictus_service.daemon.safety import FormerRun

MAX_STATUS_BYTES: Final = 1_000_000
"""Whoever sends more under the rig's name is not looked at: to copy it would hold the watch."""


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
            if len(sample.payload) <= MAX_STATUS_BYTES:
                self._last.append(sample.payload.to_bytes())

        self._subscriber = session.declare_subscriber(self._key, Callback(note, indirect=False))

    def former_run(self, fault: Fault) -> FormerRun:
        """Return how the run that just ended did, by the last status of the rig.

        Parameters
        ----------
        fault : Fault
            Why it ended.
        """
        last = self._last_status()
        if last is None or last.owner is None:
            return FormerRun(fault, None if last is None else last.last_end)
        reason = "the rig process ended"
        return FormerRun(fault, LeaseEnd(owner=last.owner, reason=reason, utc_ns=fault.utc_ns))

    def tell(self, former: FormerRun) -> None:
        """Publish that the rig has tripped; nothing if it never was present.

        Parameters
        ----------
        former : FormerRun
            How its process ended and what came of the device.

        Raises
        ------
        zenoh.ZError, LinkError
            If it cannot be published.
        """
        last = self._last_status()
        if last is None:
            return
        status = last.model_copy(
            update={
                "utc_ns": former.fault.utc_ns,
                "state": "tripped",
                "fault": former.fault,
                "last_end": former.last_end,
                "owner": None,
                "stream_open": False,
            }
        )
        if self._publisher is None:
            self._publisher = declare_latest_publisher(self._session, self._key, Topics.STATUS)
        self._publisher.put(status.to_json())

    def _last_status(self) -> RigStatus | None:
        try:
            return RigStatus.from_json(self._last[-1]) if self._last else None
        except FrameError:
            return None  # somebody else's bytes under the rig's key

    def withdraw(self) -> None:
        """Say nothing any more: the rig speaks for itself."""
        if self._publisher is not None:
            self._publisher.undeclare()  # type: ignore[no-untyped-call]
            self._publisher = None

    def close(self) -> None:
        """Listen to the rig no longer."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
