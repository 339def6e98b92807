"""What viewers of the dashboard cost: how old their data are, the API's CPU, the rig's loop."""

import contextlib
import json
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import frictus
from frictus.websocket.frames import Frame, Kind
from frictus_laboratory.benchmarks.figure import Figure, spread
from frictus_laboratory.benchmarks.occupancy import Stay
from frictus_laboratory.benchmarks.processes import RIG, Pipe, config_of, neighbour, serving

VIEWERS: Final = 20
PROCESSES: Final = 2
STREAMS: Final = ("force", "accel", "voltage")
RATE_HZ: Final = 60
WATCHED: Final = {
    "op": "watch",
    "streams": STREAMS,
    "rate_hz": RATE_HZ,
    "columns": 1_200,
    "window_s": 2.0,
    "raw": False,
}
"""As the page asks for it."""


@dataclass(slots=True)
class Taken:
    """What came to a viewer.

    Attributes
    ----------
    ages_ms : list of float
        Of the newest sample of each frame.
    state_ages_ms : list of float
        Of each state of the finger.
    lost : int
        Samples.
    """

    ages_ms: list[float] = field(default_factory=list)
    state_ages_ms: list[float] = field(default_factory=list)
    lost: int = 0


class Viewer:
    """A page without a browser: takes every frame, and notes how old its newest sample is.

    Parameters
    ----------
    port : int
        Of the API.
    rig : str
        Its name.
    """

    def __init__(self, port: int, rig: str = RIG) -> None:
        from websockets.sync.client import connect

        url = f"ws://127.0.0.1:{port}/v1/live"
        self._connection = connect(url, compression=None, max_size=None)
        self._connection.send(json.dumps({"op": "hello", "version": 1, "token": None}))
        self._connection.send(json.dumps(WATCHED | {"rig": rig}))
        self._lock = threading.Lock()
        self._taken = Taken()
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the page."""
        self._connection.close()
        self._thread.join()

    def taken(self) -> Taken:
        """Return what came since this was asked for last."""
        with self._lock:
            taken, self._taken = self._taken, Taken()
        return taken

    def _follow(self) -> None:
        for message in self._connection:
            now_ns = time.time_ns()
            if isinstance(message, bytes):
                frame = Frame.unpack(message)
                age_ms = 1e-6 * (now_ns - frame.utc_ns) - _length_ms(frame)
                with self._lock:
                    self._taken.ages_ms.append(age_ms)
                    self._taken.lost += frame.lost_samples
            elif message.startswith('{"op":"finger"'):
                state_ns = json.loads(message)["finger"]["utc_ns"]
                with self._lock:
                    self._taken.state_ages_ms.append(1e-6 * (now_ns - state_ns))


def _length_ms(frame: Frame) -> float:
    samples: int = frame.data.shape[-1] * frame.samples_per_column
    assert frame.kind is Kind.EXTREMES
    return 1e3 * samples / frame.sample_rate_hz


def view(pipe: Pipe, port: int, rigs: Sequence[str]) -> None:
    """Be a viewer of each of some rigs; asked for it, answer with what each has `Taken`."""
    with contextlib.ExitStack() as stack:
        viewers = [stack.enter_context(contextlib.closing(Viewer(port, rig))) for rig in rigs]
        pipe.send("ready")
        while True:
            pipe.recv()
            pipe.send([viewer.taken() for viewer in viewers])


def measure(seconds: float = 10.0, viewers: int = VIEWERS) -> list[Figure]:
    """Return the figures `viewer_age`, `viewer_frames`, `viewer_lateness` and `viewer_cpu`.

    Parameters
    ----------
    seconds : float
        Without viewers, and again with them.
    viewers : int
        How many pages.
    """
    config = config_of()
    with (
        serving(config, ("rig", "api")) as supervisor,
        frictus.connect(config.router.endpoint) as client,
        contextlib.ExitStack() as stack,
    ):
        rig, api = client.rig(RIG), supervisor.pid_of("api")
        alone = Stay.watch(rig, api, seconds)
        shares = [len(range(n, viewers, PROCESSES)) for n in range(PROCESSES)]
        pages = [
            stack.enter_context(neighbour(view, config.api.port, [RIG] * n)) for n in shares
        ]
        for page in pages:
            page.ask("taken")
        viewed = Stay.watch(rig, api, seconds)
        taken = [each for page in pages for each in page.ask("taken")]
    ages_ms = [age for each in taken for age in each.ages_ms]
    lost = sum(each.lost for each in taken)
    return [*_delivered(ages_ms, lost, viewers, viewed.wall_s), *_cost(alone, viewed)]


def _delivered(ages_ms: list[float], lost: int, viewers: int, wall_s: float) -> list[Figure]:
    each_s = len(ages_ms) / (wall_s * viewers * len(STREAMS))
    return [
        Figure(
            "viewer_age",
            "ms",
            spread(ages_ms, worst=True),
            remark=f"of the newest sample in every frame of {viewers} viewers of "
            f"{len(STREAMS)} streams, when it has arrived; by the rig's clock",
        ),
        Figure(
            "viewer_frames",
            "1/s",
            {"frames": each_s},
            remark=f"of each stream to each viewer, {RATE_HZ} asked for; {lost} samples lost",
        ),
    ]


def _cost(alone: Stay, viewed: Stay) -> list[Figure]:
    lateness = Figure(
        "viewer_lateness",
        "ms",
        viewed.lateness_ms,
        {f"alone_{name}": number for name, number in alone.lateness_ms.items()},
        viewed.lateness_ms["p99"] / max(alone.lateness_ms["p99"], 1e-6),
        remark="of the rig's loop beside them; ratio: of p99",
    )
    cpu = Figure(
        "viewer_cpu",
        "%",
        {"api": 100.0 * viewed.cpu},
        {"alone": 100.0 * alone.cpu},
        remark="of one core, the API's process with all viewers, and with none",
    )
    return [lateness, cpu]
