"""What systemd hears, on a socket like its own."""

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from frictus_service.daemon.processes.child_process import ServiceManager
from frictus_service.processes import free_endpoint

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="systemd and its sockets are not on Windows"
)
WAIT_S = 60.0
LOOK_S = 1.0
SERVE = """
import sys; from pathlib import Path; from frictus_service.config_file import load
from frictus_service.daemon.processes.serve import serve
serve(load(Path(sys.argv[1])), ("rig",))
"""


class Systemd:
    """Listens where a unit is told to report."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(address.replace("@", "\0", 1))

    def hears(self, timeout_s: float = WAIT_S) -> str:
        self._socket.settimeout(timeout_s)
        return self._socket.recv(4096).decode()

    def hears_of(self, wanted: Callable[[str], bool]) -> str:
        while not wanted(message := self.hears()):
            pass
        return message

    def hears_nothing_for(self, seconds: float) -> None:
        """Take what comes until nothing has come for so long."""
        try:
            while True:
                self.hears(seconds)
        except TimeoutError:
            pass

    def close(self) -> None:
        self._socket.close()


@pytest.fixture(params=["path", "abstract"])
def systemd(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Systemd]:
    if request.param == "abstract" and sys.platform != "linux":
        pytest.skip("abstract names are Linux's")
    name = "@frictus-" + tmp_path.name if request.param == "abstract" else ""
    listener = Systemd(name or str(tmp_path / "notify"))
    yield listener
    listener.close()


def test_each_message_is_one_datagram(systemd: Systemd) -> None:
    manager = ServiceManager({"NOTIFY_SOCKET": systemd.address})
    manager.ready()
    manager.status("all is well\nand more")
    manager.stopping()
    assert [systemd.hears() for _ in range(3)] == [
        "READY=1",
        "STATUS=all is well",
        "STOPPING=1",
    ]
    manager.keep_alive()  # no watchdog was asked for
    manager.status("")
    assert systemd.hears() == "STATUS="


def test_each_line_of_the_start_asks_for_more_time(systemd: Systemd) -> None:
    manager = ServiceManager({"NOTIFY_SOCKET": systemd.address})
    manager.status("rig, 70.0 s: compiling mix")
    assert systemd.hears() == (
        "STATUS=rig, 70.0 s: compiling mix\nEXTEND_TIMEOUT_USEC=120000000"
    )


def test_keep_alives_are_sent_several_times_within_the_limit(systemd: Systemd) -> None:
    now_s = [100.0]
    environment = {"NOTIFY_SOCKET": systemd.address, "WATCHDOG_USEC": "2000000"}
    manager = ServiceManager(environment, lambda: now_s[0])
    for tick in range(40):  # 50 ms each: as often as the supervisor looks
        now_s[0] = 100.0 + 0.05 * tick
        manager.keep_alive()
    manager.stopping()
    heard = list(iter(systemd.hears, "STOPPING=1"))
    assert heard == ["WATCHDOG=1"] * 4


def test_nothing_is_sent_where_nobody_listens(tmp_path: Path) -> None:
    for environment in ({}, {"NOTIFY_SOCKET": str(tmp_path / "absent")}):
        manager = ServiceManager({**environment, "WATCHDOG_USEC": "1000000"})
        manager.ready()
        manager.keep_alive()


@pytest.mark.parametrize("systemd", ["path"], indirect=True)
def test_watchdog_is_fed_by_the_loop(systemd: Systemd, tmp_path: Path) -> None:
    file = tmp_path / "frictus.toml"
    file.write_text(
        f'[router]\nendpoint = "{free_endpoint()}"\n'
        f"[limits]\nfreeze_ms = {5_000 * LOOK_S:.0f}\n",  # five looks
        encoding="utf-8",
    )
    environment = {**os.environ, "NOTIFY_SOCKET": systemd.address, "WATCHDOG_USEC": "1000000"}
    command = [sys.executable, "-c", SERVE, str(file)]
    with subprocess.Popen(command, env=environment) as served:
        try:
            told = systemd.hears_of(lambda message: message.startswith("STATUS=rig is ready"))
            process = re.search(r"process (\d+)", told)
            assert process is not None
            rig = int(process[1])
            systemd.hears_of(lambda message: message == "READY=1")
            systemd.hears_of(lambda message: message == "WATCHDOG=1")
            os.kill(rig, signal.SIGSTOP)
            systemd.hears_nothing_for(2.5 * LOOK_S)
            os.kill(rig, signal.SIGCONT)
            systemd.hears_of(lambda message: message == "WATCHDOG=1")
            served.terminate()
            systemd.hears_of(lambda message: message == "STOPPING=1")
            assert served.wait(WAIT_S) == 0
        finally:
            served.kill()
