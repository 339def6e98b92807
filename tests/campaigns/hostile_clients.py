"""Clients that harm by how they send and read: slowly, by halves, never, or what is no frame.

While they are there health must answer; when they are gone, memory and descriptors of the API
must be what they were.
"""

import base64
import contextlib
import gzip
import http.client
import json
import os
import socket
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Final

import psutil
from tests.campaigns.lines import Line

Outcomes = Counter[str]
HOST: Final = "127.0.0.1"
ANOTHER: Final = "127.0.0.2"
"""Who asks for health: one address may hold half of all connections, and theirs does."""
TAKEN_S: Final = 60.0
"""Longer than each deadline of the API: by then it has ended a connection that it must end."""
HEALTH_S: Final = 5.0
"""Longest answer of health beside them, on a machine that does other things, too."""
HEALTHS: Final = 20
"""Questions for health beside them."""
RETURN_S: Final = 20.0
SLACK_DESCRIPTORS: Final = 48
"""Connections to the database, once opened, are kept: five, of up to six files each."""
SLACK_MB: Final = 100.0
"""What Python and the allocator keep."""


class Api:
    """The API that is attacked.

    Parameters
    ----------
    port : int
    pid : int
        Of its process.
    token : str
        With every scope.
    """

    def __init__(self, port: int, pid: int, token: str) -> None:
        self.port = port
        self.process = psutil.Process(pid)
        self.head = f"Host: {HOST}:{port}\r\nAuthorization: Bearer {token}\r\n".encode()
        self.token = token

    def connected(self, sent: bytes) -> socket.socket:
        """Return a connection by which something has been sent, as far as it is taken."""
        opened = socket.create_connection((HOST, self.port), timeout=TAKEN_S)
        opened.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            opened.send(sent)
        opened.settimeout(TAKEN_S)
        return opened

    def asked(self, method: str, path: str, body: bytes = b"", more: bytes = b"") -> bytes:
        """Return the bytes of a request."""
        length = b"Content-Length: %d\r\n" % len(body)
        start = f"{method} {path} HTTP/1.1\r\n".encode()
        return start + self.head + length + more + b"\r\n" + body

    def shaken(self, more: bytes = b"") -> socket.socket:
        """Return a connection that has become a WebSocket."""
        key = base64.b64encode(os.urandom(16))
        upgrade = b"Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
        start = b"GET /v1/live HTTP/1.1\r\n" + self.head + upgrade
        opened = self.connected(start + b"Sec-WebSocket-Key: " + key + b"\r\n" + more + b"\r\n")
        answer = b""
        while b"\r\n\r\n" not in answer and (read := opened.recv(1)):
            answer += read
        return opened

    def health_s(self) -> float:
        """Return how long health took to answer; infinity where it did not."""
        asked_s = time.monotonic()
        connection = http.client.HTTPConnection(
            HOST, self.port, timeout=TAKEN_S, source_address=(ANOTHER, 0)
        )
        with contextlib.closing(connection), contextlib.suppress(OSError):
            connection.request("GET", "/v1/health")
            if connection.getresponse().status == 200:
                return time.monotonic() - asked_s
        return float("inf")


def read_all(opened: socket.socket) -> bytes:
    """Return what comes until the other end closes.

    Raises
    ------
    TimeoutError
        If nothing comes, and it does not close.
    """
    received = b""
    with contextlib.suppress(ConnectionResetError):
        while more := opened.recv(1 << 16):
            received += more
    return received


def outcome_of(answer: bytes) -> str:
    """Return the status of an answer, or that there is none."""
    return answer[9:12].decode("ascii", "replace") if answer.startswith(b"HTTP/") else "ended"


def frame(opcode: int, payload: bytes, flags: int = 0x80, masked: bool = True) -> bytes:
    """Return a frame of a WebSocket, however wrong."""
    size = len(payload)
    mask = 0x80 if masked else 0
    if size < 126:
        head = struct.pack(">BB", flags | opcode, mask | size)
    else:
        head = struct.pack(">BBH", flags | opcode, mask | 126, size)
    return head + (b"\0\0\0\0" if masked else b"") + payload  # a mask of zeros changes nothing


@contextmanager
def slow_heads(api: Api) -> Iterator[Outcomes]:
    """Heads that come in bytes, and never whole; the API ends their connections."""
    with ExitStack() as stack:
        opened = [stack.enter_context(api.connected(b"GET /v1/hea")) for _ in range(200)]
        due = threading.Event()  # never set: a pause
        for byte in b"lth H":
            due.wait(1.0)
            for one in opened:
                with contextlib.suppress(OSError):
                    one.send(bytes([byte]))
        yield Counter(outcome_of(read_all(one)) for one in opened)


@contextmanager
def half_bodies(api: Api) -> Iterator[Outcomes]:
    """Bodies of which a part comes; the API answers 408 and ends their connections."""
    half = api.asked(
        "POST", "/v1/calibrations", b"{" * 1_000, b"Content-Type: application/json\r\n"
    )
    with ExitStack() as stack:
        opened = [stack.enter_context(api.connected(half[:-900])) for _ in range(200)]
        yield Counter(outcome_of(read_all(one)) for one in opened)


@contextmanager
def unread_answers(api: Api) -> Iterator[Outcomes]:
    """A hundred requests for the reference on each connection, and no answer is read."""
    asked = api.asked("GET", "/openapi.json") * 100
    with ExitStack() as stack:
        for _ in range(100):
            stack.enter_context(api.connected(asked))
        yield Counter(unread=100)


@contextmanager
def event_streams(api: Api) -> Iterator[Outcomes]:
    """Streams of the events of a calibration that is under way; beyond 100 they are refused."""
    spec = json.dumps({"rig": "rig1", "participant": "P09", "seed": 1})
    more = b"Content-Type: application/json\r\nConnection: close\r\n"
    with ExitStack() as stack:
        with api.connected(api.asked("POST", "/v1/calibrations", spec.encode(), more)) as one:
            made = json.loads(read_all(one).partition(b"\r\n\r\n")[2])
        path = f"/v1/calibrations/{made['id']}"
        streams = [
            stack.enter_context(api.connected(api.asked("GET", f"{path}/events")))
            for _ in range(500)
        ]
        outcomes = Counter(outcome_of(one.recv(12)) for one in streams)
        yield outcomes
        end = api.asked("DELETE", path, more=b"Connection: close\r\n")
        with api.connected(end) as one:
            read_all(one)


def hello(api: Api) -> bytes:
    """Return the first message of a page."""
    return json.dumps({"op": "hello", "version": 1, "token": api.token}).encode()


@contextmanager
def floods(api: Api) -> Iterator[Outcomes]:
    """Pages that send pings and texture updates as fast as they are taken, and read nothing."""
    ping = frame(1, b'{"op":"ping","id":1}') * 2_000
    update = frame(2, b"FRTX" + bytes(16_000)) * 20  # of no stream
    with ExitStack() as stack:
        opened = [stack.enter_context(api.shaken()) for _ in range(50)]
        for one in opened:
            one.sendall(frame(1, hello(api)))
            one.setblocking(False)
        due = threading.Event()  # never set: a pause
        for _ in range(50):
            for number, one in enumerate(opened):
                with contextlib.suppress(OSError):
                    one.send(ping if number % 2 else update)
            due.wait(0.1)
        yield Counter(flooded=len(opened))


@contextmanager
def unread_sockets(api: Api) -> Iterator[Outcomes]:
    """Pages that watch every stream and read nothing; the API serves 64, and ends them."""
    streams = ["force", "accel", "voltage"]
    watch = json.dumps({"op": "watch", "rig": "rig1", "streams": streams}).encode()
    with ExitStack() as stack:
        for _ in range(200):
            opened = stack.enter_context(api.shaken())
            with contextlib.suppress(OSError):
                opened.sendall(frame(1, hello(api)) + frame(1, watch))
        yield Counter(unread=200)


@contextmanager
def malformed_frames(api: Api) -> Iterator[Outcomes]:
    """What is no frame, or none that may stand there; each ends its connection."""
    wrong = {
        "opcode": frame(3, b"x"),
        "unmasked": frame(1, b"{}", masked=False),
        "compressed": frame(1, b"{}", flags=0xC0),
        "reserved bits": frame(1, b"{}", flags=0xB0),
        "long ping": frame(9, b"x" * 126),
        "cut ping": frame(9, b"x", flags=0),
        "continuation": frame(0, b"x"),
        "not UTF-8": frame(1, b"\xff\xfe"),
        "not JSON": frame(1, b"{"),
        "binary": frame(2, b"{}"),
        "length": struct.pack(">BBQ", 0x81, 0xFF, 2**63 - 1),
        "length above": struct.pack(">BBQ", 0x81, 0xFF, 2**64 - 1),
        "close of 1 byte": frame(8, b"\x03"),
        "close code": frame(8, struct.pack(">H", 999)),
        "depth": frame(1, b"[" * 60_000),
        "noise": os.urandom(4_096),
    }
    greeted = frame(1, hello(api))
    wrong |= {
        f"update: {what}": greeted + frame(2, sent)
        for what, sent in {
            "cut": b"FRTX" + bytes(20),
            "empty": b"",
            "too long": bytes(20_000),
            "noise": os.urandom(20_000),
        }.items()
    }
    with ExitStack() as stack:
        opened = []
        for sent in 10 * list(wrong.values()):
            opened.append(stack.enter_context(api.shaken()))
            opened[-1].sendall(sent)
        for one in opened:
            read_all(one)
        yield Counter(ended=len(opened))


@contextmanager
def compressed_bombs(api: Api) -> Iterator[Outcomes]:
    """Bodies and messages that would be a thousand times as large; nothing is inflated."""
    bomb = gzip.compress(b"[" * 100_000_000)
    outcomes = Outcomes()
    more = b"Content-Type: application/json\r\nContent-Encoding: gzip\r\nConnection: close\r\n"
    for path in ("/v1/preview", "/v1/calibrations", "/v1/models"):
        for _ in range(10):
            with api.connected(b"") as opened:
                opened.sendall(api.asked("POST", path, bomb, more))
                outcomes[outcome_of(read_all(opened))] += 1
    for _ in range(30):
        with api.shaken(b"Sec-WebSocket-Extensions: permessage-deflate\r\n") as opened:
            opened.sendall(frame(1, bomb[:60_000], flags=0xC0))
            read_all(opened)
            outcomes["ended"] += 1
    yield outcomes


KINDS: Final[
    dict[
        str, tuple[Callable[[Api], contextlib.AbstractContextManager[Outcomes]], frozenset[str]]
    ]
] = {
    "slow heads": (slow_heads, frozenset({"ended"})),
    "half bodies": (half_bodies, frozenset({"408"})),
    "unread answers": (unread_answers, frozenset({"unread"})),
    "event streams": (event_streams, frozenset({"200", "503"})),
    "unread sockets": (unread_sockets, frozenset({"unread"})),
    "floods": (floods, frozenset({"flooded"})),
    "malformed frames": (malformed_frames, frozenset({"ended"})),
    "compressed bombs": (compressed_bombs, frozenset({"415", "ended"})),
}
"""What each does, and what may come of it."""


def run(kind: str, port: int, pid: int, token: str) -> Line:
    """Return the line of a batch.

    Parameters
    ----------
    kind : str
        A key of `KINDS`.
    port, pid : int
        Of the API.
    token : str
        With every scope.
    """
    api = Api(port, pid, token)
    attack, expected = KINDS[kind]
    began = usage(api)
    during = began
    failures: list[str] = []
    answered_s: list[float] = []
    stop = threading.Event()

    def watch() -> None:
        while not stop.wait(0.25) or len(answered_s) < HEALTHS:
            answered_s.append(api.health_s())

    watcher = threading.Thread(target=watch)
    watcher.start()
    outcomes = Outcomes()
    try:
        with attack(api) as outcomes:
            during = usage(api)
            stop.set()
            watcher.join()
    except TimeoutError:
        failures.append(f"a connection was not ended within {TAKEN_S:g} s")
    finally:
        stop.set()
        watcher.join()
    if unexpected := outcomes.keys() - expected:
        failures.append(f"outcomes {unexpected}, not {expected}")
    if max(answered_s) > HEALTH_S:
        failures.append(f"health took {max(answered_s):.1f} s")
    after = returned(api, began)
    if after["descriptors"] > began["descriptors"] + SLACK_DESCRIPTORS:
        failures.append(
            f"descriptors {began['descriptors']} before, {after['descriptors']} after"
        )
    if after["memory_mb"] > began["memory_mb"] + SLACK_MB:
        failures.append(f"memory {began['memory_mb']} MB before, {after['memory_mb']} after")
    return {
        "cases": sum(outcomes.values()),
        "outcomes": dict(outcomes),
        "failures": [{"what": what} for what in failures],
        "health_s": round(max(answered_s), 3),
        "usage": [began, during, after],
    }


def usage(api: Api) -> dict[str, float]:
    """Return memory and descriptors of the API."""
    count = api.process.num_handles if os.name == "nt" else api.process.num_fds
    memory_mb = api.process.memory_info().rss / 1e6
    return {"memory_mb": round(memory_mb, 1), "descriptors": count()}


def returned(api: Api, began: dict[str, float]) -> dict[str, float]:
    """Wait until the descriptors are what they were, or for `RETURN_S`; return the usage."""
    due = threading.Event()  # never set: a pause
    until_s = time.monotonic() + RETURN_S
    while (now := usage(api))["descriptors"] > began["descriptors"] + SLACK_DESCRIPTORS:
        if time.monotonic() > until_s:
            break
        due.wait(0.2)
    return now
