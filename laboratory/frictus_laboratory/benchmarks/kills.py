"""How soon the screen is at zero after somebody was killed or froze, by the wall clock."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np

import frictus
from frictus_hardware import SimulatedDeviceConfig
from frictus_hardware.simulated.device_rig import launched, recent_output
from frictus_laboratory.benchmarks.figure import Figure, Target, skipped
from frictus_laboratory.benchmarks.processes import (
    QUIET_S,
    RIG,
    STEADY,
    Pipe,
    await_status,
    config_of,
    neighbour,
    serving,
)
from frictus_service.daemon.processes.supervisor import Supervisor

LEASE_MS: Final = 300
LIMIT_MS: Final = 100.0
"""From the moment the daemon can know to zero at the screen."""
TEXTURE: Final = frictus.Spectrum(
    components=[frictus.Component(amplitude_n=0.08, cycles_per_mm=1.0)]
)
HISTORY_S: Final = 3.0
NAMES: Final = ("client_killed", "client_frozen", "rig_killed", "rig_frozen")


def hold(pipe: Pipe, endpoint: str) -> None:
    """Be a client that holds the rig until it is ended."""
    with frictus.connect(endpoint, name="doomed") as client:
        rig = client.rig(RIG)
        rig.set_scene(TEXTURE)
        with rig.arm(LEASE_MS):
            pipe.send("ready")
            pipe.recv()


def measure(repeats: int = 2) -> list[Figure]:
    """Return `client_killed`, `client_frozen`, `rig_killed` and `rig_frozen`, worst of each.

    Parameters
    ----------
    repeats : int
        How often a client is ended in each way; a rig once.
    """
    if sys.platform == "win32":
        return [
            skipped(name, "ms", "Windows has no signals to stop a process") for name in NAMES
        ]
    return [*_clients(repeats), *_rigs()]


def _clients(repeats: int) -> list[Figure]:
    config = config_of()
    with serving(config), frictus.connect(config.router.endpoint) as client:
        rig = client.rig(RIG)
        killed = [_end_client(config.router.endpoint, rig, "SIGKILL") for _ in range(repeats)]
        frozen = [_end_client(config.router.endpoint, rig, "SIGSTOP") for _ in range(repeats)]
    return [
        Figure(
            "client_killed",
            "ms",
            {"zero": max(killed)},
            target=Target("zero", "at most", LIMIT_MS),
            remark=f"from SIGKILL of the client that holds the rig to the last driven sample; "
            f"worst of {repeats}",
        ),
        Figure(
            "client_frozen",
            "ms",
            {"zero": max(frozen), "zero_after_lease": max(frozen) - LEASE_MS},
            {"lease": float(LEASE_MS)},
            target=Target("zero_after_lease", "at most", LIMIT_MS),
            remark=f"the same from SIGSTOP, and from the longest that its lease may last then; "
            f"worst of {repeats}",
        ),
    ]


def _end_client(endpoint: str, rig: frictus.Rig, end: str) -> float:
    """Return the time from a signal to the last driven sample, ms."""
    with rig.blocks("voltage", timeout_s=QUIET_S) as feed:
        blocks = (item for item in feed if isinstance(item, frictus.Block))
        with _doomed(endpoint) as pid:
            loud = next(block for block in blocks if block.data.any())
            ended_ns = time.time_ns()
            os.kill(pid, getattr(signal, end))
            for block in blocks:
                if block.data.any():
                    loud = block
                elif block.first_sample > loud.first_sample + block.sample_rate_hz / 2.0:
                    break
        driven = int(np.flatnonzero(loud.data[0])[-1])
        silent_ns = loud.utc_ns + 1e9 * (driven + 1) / loud.sample_rate_hz
    await_status(rig, lambda status: status.state == "disarmed")
    return 1e-6 * (silent_ns - ended_ns)


@contextmanager
def _doomed(endpoint: str) -> Iterator[int]:
    """Run a client that holds the rig, and return its process id; killed at the end."""
    with neighbour(hold, endpoint) as client:
        try:
            yield client.pid
        finally:
            os.kill(client.pid, signal.SIGKILL)


def _rigs() -> list[Figure]:
    figures = []
    with launched(STEADY) as device:
        config = config_of(device)
        with serving(config) as supervisor, frictus.connect(config.router.endpoint) as client:
            rig = client.rig(RIG)
            zero, again = _end_rig(supervisor, rig, device, "SIGKILL")
            figures.append(
                Figure(
                    "rig_killed",
                    "ms",
                    {"zero": zero, "present_again": again},
                    remark="from SIGKILL of the rig process to the last driven sample of a "
                    "device that holds its last value, and to the first status of the rig "
                    "that was started in its place",
                )
            )
            zero, again = _end_rig(supervisor, rig, device, "SIGSTOP")
            freeze_ms = float(config.limits.freeze_ms)
            figures.append(
                Figure(
                    "rig_frozen",
                    "ms",
                    {
                        "zero": zero,
                        "zero_after_limit": zero - freeze_ms,
                        "present_again": again,
                    },
                    {"limit": freeze_ms},
                    remark="the same from SIGSTOP, and from the age limit of its heartbeat",
                )
            )
    return figures


def _end_rig(
    supervisor: Supervisor, rig: frictus.Rig, device: SimulatedDeviceConfig, end: str
) -> tuple[float, float]:
    """Return the times from a signal to zero at the device, and to the rig's return, ms."""
    run = await_status(rig, lambda status: status.state == "disarmed").run
    rig.set_scene(TEXTURE)
    lease = rig.arm()
    with rig.blocks("voltage", timeout_s=QUIET_S) as feed:
        next(item for item in feed if isinstance(item, frictus.Block) and item.data.any())
    ended_s = time.monotonic()
    os.kill(supervisor.pid_of("rig"), getattr(signal, end))
    await_status(rig, lambda status: status.state == "tripped")
    output = recent_output(device, HISTORY_S)
    read_s = time.monotonic()
    driven = int(np.flatnonzero(output.voltage_v)[-1])
    silent_s = (output.voltage_v.size - 1 - driven) / STEADY.sample_rate_hz
    await_status(rig, lambda status: status.run != run)
    again_s = time.monotonic()
    lease.wait_lost(QUIET_S)
    lease.disarm()
    return 1e3 * (read_s - silent_s - ended_s), 1e3 * (again_s - ended_s)
