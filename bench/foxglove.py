"""What a viewer gets of a running rig over Foxglove's WebSocket, live.

`uv run python bench/foxglove.py --seconds 30` runs the service with a simulated rig and
`frictus foxglove`, subscribes to force, acceleration, voltage, render and the finger, and
prints a table of `docs/bridges.md`; `--samples-per-column 1` makes every sample a message.
"""

import argparse
import asyncio
import json
import os
import struct
import subprocess
import sys
import time
from collections import defaultdict
from typing import Final

import numpy as np
import psutil
from numpy.typing import NDArray
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

from frictus_laboratory.benchmarks.processes import config_of, serving

TOPICS: Final = (
    "stream/force",
    "stream/accel",
    "stream/voltage",
    "stream/render",
    "state/finger",
    "recording/gaps",
)
COMMAND: Final = "from frictus_service.cli import main; main()"
HEAD: Final = "| topic | messages | missing | age p50 / p99 / most, ms |\n|---|---|---|---|\n"
AHEAD: Final = "stream/render"
"""Stamped by when it plays: a lead later than it comes."""


async def look(url: str, seconds: float) -> dict[str, NDArray[np.int64]]:
    """Return stamps and arrivals by topic, ns, shape (n, 2)."""
    came: list[tuple[str | bytes, int]] = []  # read later: here every microsecond counts
    async with connect(
        url, subprotocols=[Subprotocol("foxglove.sdk.v1")], max_size=None
    ) as socket:
        channels: dict[str, int] = {}
        while not channels.keys() >= set(TOPICS):
            told = json.loads(await socket.recv())
            for one in told.get("channels", ()):
                channels[one["topic"]] = one["id"]
        asked = [{"id": at, "channelId": channels[topic]} for at, topic in enumerate(TOPICS)]
        await socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            came.append((await socket.recv(), time.time_ns()))
    stamps: defaultdict[str, list[tuple[int, int]]] = defaultdict(list)
    for message, at_ns in came:
        if isinstance(message, bytes):
            _, number, stamp_ns = struct.unpack_from("<BIQ", message)
            stamps[TOPICS[number]].append((stamp_ns, at_ns))
    return {topic: np.array(rows) for topic, rows in stamps.items()}


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--samples-per-column", type=int, default=50)
    given = parser.parse_args()
    seconds = given.seconds
    config = config_of()
    command = [sys.executable, "-c", COMMAND, "foxglove", "--json", "--port", "0"]
    command += ["--rig", config.rig, "--router", config.router.endpoint]
    command += ["--samples-per-column", str(given.samples_per_column)]
    with (
        serving(config),
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as bridge,
    ):
        assert bridge.stdout is not None
        url = json.loads(bridge.stdout.readline())["url"]
        process = psutil.Process(bridge.pid)
        process.cpu_percent()
        came = asyncio.run(look(url, seconds))
        percent, load = process.cpu_percent(), os.getloadavg()[0]
        bridge.kill()
    sys.stdout.write(HEAD)
    for topic, rows in came.items():
        steps = np.diff(rows[:, 0])
        missing = int(np.sum(np.rint(steps / np.median(steps)) - 1))
        ages = 1e-6 * (rows[:, 1] - rows[:, 0])
        told = " / ".join(
            f"{value:.1f}" for value in (*np.percentile(ages, (50, 99)), ages.max())
        )
        note = " (stamped ahead)" if topic == AHEAD else ""
        assert np.all(steps > 0), topic
        sys.stdout.write(f"| {topic} | {len(rows)} | {missing} | {told}{note} |\n")
    sys.stdout.write(
        f"\n{seconds:g} s; {percent:.0f} % of a core for the bridge; load {load:.1f} on "
        f"{os.cpu_count()} cores.\n"
    )


if __name__ == "__main__":
    main()
