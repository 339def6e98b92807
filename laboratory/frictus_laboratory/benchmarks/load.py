"""What weighs on a rig: subscribers in processes of their own, and an API that is kept busy."""

import contextlib
import http.client
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

import frictus
from frictus.watched_rig import StreamName
from frictus_laboratory.benchmarks.processes import RIG, Neighbour, Pipe, neighbour
from frictus_service.config import Config

STREAMS: Final[tuple[StreamName, ...]] = ("force", "accel", "voltage", "truth")
PROCESSES: Final = 4
PATHS: Final = (
    f"/v1/rigs/{RIG}",
    "/metrics",
    f"/v1/rigs/{RIG}/scene",
    "/v1/textures/vinyl",
    f"/v1/rigs/{RIG}/time",
)


@dataclass(slots=True)
class Tally:
    """What one subscriber got of all streams.

    Attributes
    ----------
    received : int
        Blocks.
    lost : int
        Blocks that never came or that its own queue could not hold.
    gaps : dict
        Blocks that the gaps account for, by reason.
    """

    received: int = 0
    lost: int = 0
    gaps: dict[str, int] = field(default_factory=dict)

    def note(self, gap: frictus.Gap) -> None:
        """Take a gap in."""
        self.gaps[gap.reason] = self.gaps.get(gap.reason, 0) + gap.missing_blocks

    @property
    def gap_blocks(self) -> int:
        """Blocks that all gaps account for."""
        return sum(self.gaps.values())


class Subscriber:
    """Follows all streams of a rig and its finger, each in a thread, decoded.

    Parameters
    ----------
    endpoint : str
        Zenoh endpoint of the router.
    name : str
        Of the rig.
    """

    def __init__(self, endpoint: str, name: str = RIG) -> None:
        self._client = frictus.connect(endpoint, patient=True)
        rig = self._client.rig(name)
        self._feeds = [rig.blocks(stream) for stream in STREAMS]
        self._tallies = [Tally() for _ in self._feeds]
        self._fingers = rig.fingers()
        self._threads = [
            threading.Thread(target=self._follow, args=pair)
            for pair in zip(self._feeds, self._tallies, strict=True)
        ]
        self._threads.append(threading.Thread(target=self._follow_finger))
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop following and leave."""
        self._client.close()
        for thread in self._threads:
            thread.join()

    def tally(self) -> Tally:
        """Return what was received until now, over all streams."""
        total = Tally()
        for feed, tally in zip(self._feeds, self._tallies, strict=True):
            total.received += feed.received
            total.lost += feed.lost
            for reason, count in tally.gaps.items():
                total.gaps[reason] = total.gaps.get(reason, 0) + count
        return total

    def _follow(self, feed: frictus.BlockFeed, tally: Tally) -> None:
        for item in feed:
            if isinstance(item, frictus.Gap):
                tally.note(item)

    def _follow_finger(self) -> None:
        for _ in self._fingers:
            pass


def subscribe(pipe: Pipe, endpoint: str, rigs: Sequence[str]) -> None:
    """Be a subscriber of each of some rigs; asked for it, answer with a `Tally` of each."""
    with contextlib.ExitStack() as stack:
        subscribers = [
            stack.enter_context(contextlib.closing(Subscriber(endpoint, rig))) for rig in rigs
        ]
        pipe.send("ready")
        while True:
            pipe.recv()
            pipe.send([subscriber.tally() for subscriber in subscribers])


def keep_busy(pipe: Pipe, config: Config) -> None:
    """Ask the API one thing after the other; asked for it, answer with counts by status."""
    answers: dict[int, int] = {}
    over = threading.Event()

    def ask() -> None:
        connection = http.client.HTTPConnection(config.api.host, config.api.port, timeout=30.0)
        with contextlib.closing(connection):
            while not over.is_set():
                for path in PATHS:
                    connection.request("GET", path)
                    response = connection.getresponse()
                    response.read()
                    answers[response.status] = answers.get(response.status, 0) + 1

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        pipe.send("ready")
        while True:
            pipe.recv()
            pipe.send(dict(answers))
    finally:
        over.set()
        thread.join()


class Load:
    """The load while it is on.

    Parameters
    ----------
    subscribers : list of Neighbour
        One for each process.
    api : Neighbour
        The process that reads over REST.
    """

    def __init__(self, subscribers: list[Neighbour], api: Neighbour) -> None:
        self._subscribers = subscribers
        self._api = api

    def tallies(self) -> list[Tally]:
        """Return what each subscriber got until now."""
        found: list[Tally] = []
        for process in self._subscribers:
            found += process.ask("tally")
        return found

    def answers(self) -> dict[int, int]:
        """Return how often the API answered with each status."""
        counts: dict[int, int] = self._api.ask("answers")
        return counts


@contextmanager
def loaded(config: Config, subscribers: int) -> Iterator[Load]:
    """Put a service under load.

    Parameters
    ----------
    config : Config
        Of a service that runs, the API included.
    subscribers : int
        How many, spread over `PROCESSES`.
    """
    with contextlib.ExitStack() as stack:
        following = [
            stack.enter_context(
                neighbour(
                    subscribe,
                    config.router.endpoint,
                    [RIG] * len(range(n, subscribers, PROCESSES)),
                )
            )
            for n in range(PROCESSES)
        ]
        yield Load(following, stack.enter_context(neighbour(keep_busy, config)))
