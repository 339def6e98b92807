"""The API in a thread of this process, with a real socket, and a page that talks to it."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.patience import PATIENT
from websockets.sync.client import ClientConnection, connect

from frictus.websocket.frames import Frame
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.guided import ClientFinger
from frictus_service.api.server import run_api
from frictus_service.config import (
    ApiConfig,
    Config,
    RegistryConfig,
    RouterConfig,
    Token,
)
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.processes import free_endpoint, free_port

TOKENS = {
    "read": ("read",),
    "render": ("read", "render"),
    "guest": ("read", "render"),
    "admin": ("admin",),
}
SECRETS = {name: f"the-{name}-token-of-a-test" for name in TOKENS}
PATIENCE_S = 20.0


def configuration(
    router: str, folder: Path, tokens: bool, origins: tuple[str, ...] = ()
) -> Config:
    named = tuple(
        Token(name=name, scopes=scopes, value=SECRETS[name]) for name, scopes in TOKENS.items()
    )
    return Config(
        router=RouterConfig(endpoint=router, host=False),
        textures=folder / "textures",
        studies=folder / "studies",
        registry=RegistryConfig(url=f"sqlite:///{folder / 'registry.db'}"),
        api=ApiConfig(port=free_port(), tokens=named if tokens else (), origins=origins),
    )


@dataclass
class Page:
    """What a page does, without a browser: it reads until something that it waits for comes."""

    connection: ClientConnection
    frames: list[Frame] = field(default_factory=list)
    told: list[dict[str, Any]] = field(default_factory=list)

    def say(self, op: str, **fields: Any) -> None:
        self.connection.send(json.dumps({"op": op, **fields}))

    def read(self) -> Frame | dict[str, Any]:
        message = self.connection.recv(timeout=PATIENCE_S)
        if isinstance(message, bytes):
            self.frames.append(Frame.unpack(message))
            return self.frames[-1]
        self.told.append(json.loads(message))
        return self.told[-1]

    def wait(self, op: str, holds: Callable[[Any], bool] = lambda _: True) -> Any:
        """Return the next message `op` for which something holds."""
        while True:
            message = self.read()
            if isinstance(message, dict) and message["op"] == op and holds(message):
                return message
            assert op == "refused" or not _refusal(message), message

    def frame(self, holds: Callable[[Frame], bool] = lambda _: True) -> Frame:
        """Return the next frame for which something holds."""
        while True:
            message = self.read()
            if isinstance(message, Frame) and holds(message):
                return message


def _refusal(message: Frame | dict[str, Any]) -> bool:
    return isinstance(message, dict) and message["op"] == "refused"


@contextmanager
def page_at(
    port: int, hello: bool = True, who: str | None = None, **options: Any
) -> Iterator[Page]:
    """Open a page; `who` is the name of its token."""
    url = f"ws://127.0.0.1:{port}/v1/live"
    options = {"compression": None, "max_size": None, **options}
    with connect(url, open_timeout=PATIENCE_S, close_timeout=5.0, **options) as connection:
        page = Page(connection)
        if hello:
            page.say("hello", version=1, token=None if who is None else SECRETS[who])
            page.wait("welcome")
        yield page


@contextmanager
def serving(config: Config) -> Iterator[int]:
    """Run the API in a thread; yield its port."""
    stop, ready = threading.Event(), threading.Event()
    thread = threading.Thread(target=run_api, args=(config, stop, ready))
    thread.start()
    try:
        assert ready.wait(PATIENCE_S)
        yield config.api.port
    finally:
        stop.set()
        thread.join(PATIENCE_S)
    assert not thread.is_alive()


@contextmanager
def rig_that_follows_pages() -> Iterator[str]:
    """Run a simulated rig whose finger follows pages; yield its router."""
    endpoint = free_endpoint()
    config = Config(
        backend=SimulatedConfig(finger=ClientFinger(smoothing_hz=50.0)),
        router=RouterConfig(endpoint=endpoint),
        api=ApiConfig(enabled=False),
        limits=PATIENT,
    )
    with Supervisor(config, ("rig",)) as supervisor:
        supervisor.wait_ready(100.0)
        yield endpoint
