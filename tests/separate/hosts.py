"""Hosts of their own on one machine: network namespaces, each linked to a hub and no other.

A namespace lives as long as a process in it. Each is held by one that ends when its standard
input does, so nothing stays behind, however these tests end.
"""

import contextlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from typing import Any, Final

import pytest

TOOLS: Final = ("ip", "unshare", "nsenter", "setpriv")
_HOLD: Final = ("sh", "-c", "echo held; exec cat")


class Host:
    """A network namespace.

    Parameters
    ----------
    name : str
        At most 8 letters.
    enter : sequence of str
        What has a command run where the namespace shall be made.
    """

    def __init__(self, name: str, enter: Sequence[str]) -> None:
        self.name = name
        self._keeper = subprocess.Popen(
            [*enter, *_HOLD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self._keeper.stdout is not None
        if self._keeper.stdout.readline().strip() != "held":
            _, said = self._keeper.communicate()
            raise OSError(f"no network namespace can be made here: {said.strip()}")
        self.pid = self._keeper.pid

    def inside(self, *command: str) -> list[str]:
        """Return the command line that runs a command on this host."""
        user = [] if os.geteuid() == 0 else ["--user", "--preserve-credentials"]
        return ["nsenter", "--target", str(self.pid), "--net", *user, "--", *command]

    def python(self, *arguments: str, **how: Any) -> "subprocess.Popen[str]":
        """Start Python on this host; it ends with us."""
        return subprocess.Popen(
            self.inside("setpriv", "--pdeathsig", "TERM", sys.executable, *arguments),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
            **how,
        )

    def ip(self, *words: str) -> None:
        """Configure the network of this host, as `ip` does."""
        done = subprocess.run(self.inside("ip", *words), capture_output=True, text=True)
        if done.returncode:
            raise OSError(f"ip {' '.join(words)}: {done.stderr.strip()}")

    def close(self) -> None:
        """Let the namespace go, once nothing runs in it."""
        self._keeper.communicate("")


class Star:
    """A hub and hosts around it, each on a network of two.

    Parameters
    ----------
    hub : Host
    hosts : dict of Host
    """

    def __init__(self, hub: Host, hosts: dict[str, Host]) -> None:
        self.hub = hub
        self.hosts = hosts
        hub.ip("link", "set", "lo", "up")
        for number, host in enumerate(hosts.values(), 1):
            link = _link_to(host.name)
            far = ("peer", "name", "uplink", "netns", str(host.pid))
            hub.ip("link", "add", link, "type", "veth", *far)
            hub.ip("address", "add", f"10.77.{number}.1/24", "dev", link)
            hub.ip("link", "set", link, "up")
            host.ip("link", "set", "lo", "up")
            host.ip("address", "add", f"10.77.{number}.2/24", "dev", "uplink")
            host.ip("link", "set", "uplink", "up")

    def hub_address(self, name: str) -> str:
        """Return the address under which a host reaches the hub."""
        return f"10.77.{list(self.hosts).index(name) + 1}.1"

    def cut(self, name: str) -> None:
        """Pull a host's cable out of the hub."""
        self.hub.ip("link", "set", _link_to(name), "down")

    def heal(self, name: str) -> None:
        """Put it back."""
        self.hub.ip("link", "set", _link_to(name), "up")


def _link_to(name: str) -> str:
    return f"to-{name}"


@contextlib.contextmanager
def star(*names: str) -> Iterator[Star]:
    """Make a hub and hosts; skip the test where that cannot be done.

    Parameters
    ----------
    *names : str
        Of the hosts.
    """
    missing = [tool for tool in TOOLS if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"network namespaces need {', '.join(missing)}")
    root = os.geteuid() == 0
    with contextlib.ExitStack() as undo:
        try:
            first = ["unshare", "--net"] if root else ["unshare", "-Ur", "--net"]
            hub = Host("hub", first)
            undo.callback(hub.close)
            # One user namespace for all: whoever made the hub may then link it to the others.
            share = ["nsenter", "--target", str(hub.pid), "--user", "--preserve-credentials"]
            later = ["unshare", "--net"] if root else [*share, "--", "unshare", "--net"]
            hosts = {}
            for name in names:
                hosts[name] = Host(name, later)
                undo.callback(hosts[name].close)
            made = Star(hub, hosts)
        except OSError as error:
            pytest.skip(f"network namespaces cannot be made here: {error}")
        yield made
