"""A viewer of Foxglove's WebSocket protocol, as far as a test needs one.

https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md
"""

import json
import struct
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

SUBPROTOCOL: Final = Subprotocol("foxglove.sdk.v1")
MESSAGE: Final = struct.Struct("<BIQ")
"""Opcode 1, subscription, time in ns."""


class Came(NamedTuple):
    """A message."""

    log_ns: int
    data: bytes


class FoxgloveViewer:
    """Connected to a server.

    Attributes
    ----------
    channels : dict of str to dict
        As they are advertised, by topic.
    came : dict of str to list of Came
        By topic.
    """

    def __init__(self, socket: ClientConnection) -> None:
        self.channels: dict[str, dict[str, Any]] = {}
        self.came: dict[str, list[Came]] = defaultdict(list)
        self._topics: dict[int, str] = {}
        self._socket = socket

    def receive(self, timeout_s: float = 20.0) -> None:
        """Take in one message, whatever it is."""
        message = self._socket.recv(timeout_s)
        if isinstance(message, bytes):
            opcode, subscription, log_ns = MESSAGE.unpack_from(message)
            assert opcode == 1
            self.came[self._topics[subscription]].append(Came(log_ns, message[MESSAGE.size :]))
            return
        told = json.loads(message)
        if told["op"] == "advertise":
            self.channels |= {one["topic"]: one for one in told["channels"]}

    def await_channels(self, *topics: str) -> None:
        """Receive until these are advertised."""
        while not self.channels.keys() >= set(topics):
            self.receive()

    def subscribe(self, *topics: str) -> None:
        """Ask for the messages of topics that were advertised."""
        asked = []
        for topic in topics:
            number = len(self._topics)
            self._topics[number] = topic
            asked.append({"id": number, "channelId": self.channels[topic]["id"]})
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))


@contextmanager
def viewing(port: int) -> Iterator[FoxgloveViewer]:
    """Connect to a server of this machine."""
    with connect(
        f"ws://127.0.0.1:{port}", subprotocols=[SUBPROTOCOL], max_size=None, max_queue=None
    ) as socket:
        assert socket.subprotocol == SUBPROTOCOL
        yield FoxgloveViewer(socket)
