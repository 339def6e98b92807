"""A site on one machine: rigs on two linked routers, two APIs on one database, their readers.

Every part is started as `frictus` starts it on a machine of its own.
"""

import contextlib
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import psutil
from tests.campaigns.balancer import balancing
from tests.campaigns.hosted import Hosted
from tests.campaigns.owner import UPDATE_S, own
from tests.campaigns.service import Said, config_in, http_status, publish, serving
from tests.service.registry.postgresql import server

import frictus
from frictus.errors import FrictusError
from frictus_hardware import ReplayConfig, SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.benchmarks.load import Tally, subscribe
from frictus_laboratory.benchmarks.processes import Pipe, neighbour
from frictus_laboratory.benchmarks.viewers import Taken, view
from frictus_service.config import ApiConfig, Config, RegistryConfig, RouterConfig
from frictus_service.processes import free_endpoint, free_port
from frictus_service.recording.tape import export_tape

TAPE_S: Final = 20.0
LEASE_MS: Final = 5_000
PROCESSES: Final = 2
MODELS: Final = 4


@dataclass(frozen=True, slots=True)
class Size:
    """How much of a site there is.

    Attributes
    ----------
    rigs : int
        Each with a supervisor, a recorder that records and an owner who streams at 5 Hz.
    subscribers, viewers : int
        Of all rigs together: of four streams each, and of three at 60 frames/s.
    across : bool
        Whether subscribers read at the router that their rig does not use.
    """

    rigs: int
    subscribers: int
    viewers: int
    across: bool = True

    @property
    def name(self) -> str:
        """What it is called in a line."""
        near = "" if self.across else " at the rigs' router"
        return f"{self.rigs} rigs, {self.subscribers} subscribers{near}, {self.viewers} viewers"


def hold(pipe: Pipe, rigs: Sequence[tuple[str, str]]) -> None:
    """Own rigs, each an endpoint and a name, until the pipe closes."""
    ending = threading.Event()

    def pause() -> None:
        if ending.wait(UPDATE_S):
            raise InterruptedError

    def keep(endpoint: str, name: str) -> None:
        with contextlib.suppress(InterruptedError):
            own(endpoint, LEASE_MS, pause, name)

    threads = [threading.Thread(target=keep, args=rig) for rig in rigs]
    for thread in threads:
        thread.start()
    pipe.send("ready")
    try:
        pipe.recv()
    finally:
        ending.set()
        for thread in threads:
            thread.join()


def make_tape(folder: Path) -> Path:
    """Record a simulated rig that is driven, and return what plays it as a rig."""
    config = config_in(folder / "made", SimulatedConfig(finger=SteadyStrokes()))
    with (
        serving(config, Said(), ("rig", "recorder")),
        frictus.connect(config.router.endpoint) as client,
        neighbour(hold, [(config.router.endpoint, config.rig)]),
    ):
        rig = client.rig(config.rig, config.site)
        rig.record("tape")
        threading.Event().wait(TAPE_S)
        rig.end_recording()
    tape = folder / "tape.npz"
    export_tape(config.recordings / "tape.mcap", tape)
    return tape


class Site:
    """A site of some size while it is entered.

    Parameters
    ----------
    size : Size
    tape : Path
        What its rigs play.
    folder : Path
        For all that it keeps.
    """

    def __init__(self, size: Size, tape: Path, folder: Path) -> None:
        self.size = size
        endpoints = (free_endpoint(), free_endpoint())
        self.routers = [
            Hosted(Config(router=RouterConfig(endpoint=endpoint, links=links)), (), True)
            for endpoint, links in zip(endpoints, ((endpoints[1],), ()), strict=True)
        ]
        self.rigs = [
            Hosted(
                Config(
                    rig=f"rig{n + 1}",
                    backend=ReplayConfig(file=tape, at_end="loop"),
                    router=RouterConfig(endpoint=endpoints[n % 2], host=False),
                    recordings=folder / f"rig{n + 1}",
                ),
                ("rig", "recorder"),
            )
            for n in range(size.rigs)
        ]
        self._endpoints, self._folder = endpoints, folder
        self._undo = contextlib.ExitStack()

    @property
    def names(self) -> list[str]:
        """Names of the rigs."""
        return [rig.config.rig for rig in self.rigs]

    def _api(self, endpoint: str, url: str, name: str) -> Hosted:
        folder = self._folder / name
        return Hosted(
            Config(
                router=RouterConfig(endpoint=endpoint, host=False),
                api=ApiConfig(port=free_port()),
                registry=RegistryConfig(url=url),
                recordings=folder / "recordings",
                studies=folder / "studies",
                textures=folder / "textures",
            ),
            ("api",),
        )

    def __enter__(self) -> "Site":
        """Start all of it, those who weigh on it last."""
        with contextlib.ExitStack() as undo:
            url = f"{undo.enter_context(server())}postgres"
            self.apis = [
                self._api(endpoint, url, f"api{n}")
                for n, endpoint in enumerate(self._endpoints)
            ]
            for together in (self.routers, [*self.rigs, *self.apis]):
                undo.callback(_end, together)
                for hosted in together:
                    hosted.begin()
                for hosted in together:
                    hosted.await_ready()
            port, self._proxy = undo.enter_context(
                balancing([api.config.api.port for api in self.apis])
            )
            self.front = Config(api=ApiConfig(port=port))
            self.client = undo.enter_context(frictus.connect(self._endpoints[0]))
            self.owners = [
                undo.enter_context(neighbour(hold, owned))
                for side in range(2)
                if (owned := [self._seen(n, side) for n in range(side, self.size.rigs, 2)])
            ]
            for rig in self._remote():
                rig.record("site")
            self.subscribers = [
                undo.enter_context(neighbour(subscribe, self._endpoints[side], rigs))
                for side in range(2)
                if (rigs := self._read_at(side))
            ]
            self.viewers = [
                undo.enter_context(neighbour(view, port, rigs))
                for process in range(PROCESSES)
                if (rigs := self._turns(self.size.viewers)[process::PROCESSES])
            ]
            self._undo = undo.pop_all()
        return self

    def __exit__(self, *_error: object) -> None:
        """End all of it."""
        self._undo.close()

    def _seen(self, number: int, side: int) -> tuple[str, str]:
        return self._endpoints[side], self.rigs[number].config.rig

    def _turns(self, count: int) -> list[str]:
        return [self.names[n % self.size.rigs] for n in range(count)]

    def _read_at(self, side: int) -> list[str]:
        """Return the rigs that subscribers read at a router, one for each subscriber."""
        other = side if not self.size.across else 1 - side
        return [
            name for name in self._turns(self.size.subscribers) if self._side(name) == other
        ]

    def _side(self, name: str) -> int:
        return self.names.index(name) % 2

    def _remote(self) -> Iterator[frictus.Rig]:
        for hosted in self.rigs:
            yield self.client.rig(hosted.config.rig, hosted.config.site)

    def processes(self) -> dict[str, list[int]]:
        """Return the process ids of each kind of part."""
        return {
            "rig": [hosted.pid("rig") for hosted in self.rigs],
            "rig's supervisor": [hosted.pid("supervisor") for hosted in self.rigs],
            "recorder": [hosted.pid("recorder") for hosted in self.rigs],
            "routers": [hosted.pid("supervisor") for hosted in self.routers],
            "APIs": [hosted.pid("api") for hosted in self.apis],
            "APIs' supervisors": [hosted.pid("supervisor") for hosted in self.apis],
            "nginx": _tree([self._proxy]),
            "PostgreSQL": _tree(_named("postgres")),
            "subscribers": [process.pid for process in self.subscribers],
            "viewers": [process.pid for process in self.viewers],
            "owners": [process.pid for process in self.owners],
        }

    def tally(self) -> Tally:
        """Return what all subscribers got until now."""
        total = Tally()
        for process in self.subscribers:
            for tally in process.ask("tally"):
                total.received += tally.received
                total.lost += tally.lost
        return total

    def taken(self) -> Taken:
        """Return what came to all viewers since this was asked for last."""
        total = Taken()
        for process in self.viewers:
            for taken in process.ask("taken"):
                total.ages_ms += taken.ages_ms
                total.state_ages_ms += taken.state_ages_ms
                total.lost += taken.lost
        return total

    def states(self) -> list[frictus.RigStatus]:
        """Return the state of every rig that answers."""
        return list(_answers(rig.status for rig in self._remote()))

    def recorder_lost(self) -> int:
        """Return how many blocks the recordings miss."""
        return sum(
            state.lost_blocks for state in _answers(rig.recording for rig in self._remote())
        )

    def ended(self) -> list[str]:
        """Return what has ended since this was asked for last."""
        return [
            line
            for hosted in [*self.routers, *self.rigs, *self.apis]
            for line in hosted.said.new_ends()
        ]

    def published_wrongly(self) -> list[str]:
        """Publish models by the proxy; return what an API does not answer as it should."""
        wrong = []
        for _ in range(MODELS):
            status, reference = publish(self.front)
            wrong += [] if status == 201 else [f"publishing a model: {status}"]
            for api in self.apis if status == 201 else ():
                found = http_status(api.config, f"/v1/models/{reference}")
                wrong += [] if found == 200 else [f"model {reference} at an API: {found}"]
        return wrong


def _end(together: Sequence[Hosted]) -> None:
    for hosted in together:
        hosted.tell_end()
    for hosted in together:
        hosted.end()


def _answers(asks: Iterator[Callable[[], Any]]) -> Iterator[Any]:
    for ask in asks:
        with contextlib.suppress(FrictusError):  # a silent one is counted by who asks
            yield ask()


def _named(name: str) -> list[int]:
    return [child.pid for child in psutil.Process().children() if child.name() == name]


def _tree(pids: list[int]) -> list[int]:
    children = [
        child.pid for pid in pids for child in psutil.Process(pid).children(recursive=True)
    ]
    return [*pids, *children]
