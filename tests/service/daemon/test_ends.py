"""Whatever tells a service to end, at whatever moment: its parts end in order."""

import os
import signal
import subprocess
import sys

import pytest

from frictus_service.processes import free_endpoint

SERVES = """
import sys
from frictus_service.config import Config, RouterConfig
from frictus_service.daemon.processes.serve import serve
if __name__ == "__main__":
    serve(Config(router=RouterConfig(endpoint=sys.argv[1])), ("rig",))
"""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")


def run_until(words: str, number: int) -> tuple[list[str], int]:
    """Signal a whole terminal once its service says something; return what it said, its end."""
    command = [sys.executable, "-c", SERVES, free_endpoint()]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stderr is not None
        said: list[str] = []
        for line in process.stderr:
            said.append(line)
            if words in line:
                break
        os.killpg(process.pid, number)
        said += process.stderr.readlines()
    return said, process.returncode


@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP"])
def test_a_terminal_that_closes_ends_a_service_as_ctrl_c_does(name: str) -> None:
    """It killed the rig where it was: a device that holds its last value goes on with it."""
    said, code = run_until("ready; Ctrl-C stops", getattr(signal, name))
    assert code == 0
    assert said[-2:] == ["stopping: the output ramps to zero\n", "stopped\n"]


def test_a_service_that_starts_can_be_ended() -> None:
    """Its start, which compiles for minutes on a new installation, went on to the end."""
    said, code = run_until("router listens", signal.SIGINT)
    assert code == 0
    assert not any("ready; Ctrl-C" in line for line in said)
    assert said[-1] == "stopped\n"
