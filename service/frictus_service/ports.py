"""Free ports of this machine, for a service that shall disturb nothing else."""

import socket


def free_port() -> int:
    """Return a port of this machine that nobody uses just now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def free_endpoint() -> str:
    """Return a Zenoh endpoint of this machine at a free port."""
    return f"tcp/127.0.0.1:{free_port()}"
