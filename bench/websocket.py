"""What a client gets of two raw 20 kHz streams and the finger over the WebSocket.

`uv run python bench/websocket.py --client python --seconds 30` runs the service and
`bench/websocket_client.py`; `--client c` compiles `bench/websocket_client.c`; `--client node`
runs `npm run measure` of clients/typescript, for which it needs the registry of npm; `--client
octave` runs `bench/websocket_client.m`. It prints a table of `docs/websocket.md`.
"""

import argparse
import atexit
import json
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Final

import psutil

sys.path.insert(0, str(Path(__file__).parents[1]))  # so that a script finds the tests
from tests.typescript.package import package, run

from frictus_laboratory.benchmarks.processes import config_of, serving
from frictus_service.config import Limits

CLIENTS: Final = {"c": "C", "node": "Node", "octave": "Octave", "python": "Python"}
HERE: Final = Path(__file__).parent
HEADERS: Final = HERE.parent / "clients" / "c"
HEAD: Final = "| what | of how many | lost | age p50 / p99 / most, ms |\n|---|---|---|---|\n"


def prepared(client: str) -> tuple[tuple[str, ...], Path]:
    """Return the command of a client, compiled if it must be, and its folder."""
    if client == "python":
        return (sys.executable, "websocket_client.py"), HERE
    if client == "node":
        return ("node", "--experimental-websocket", "build/bench/measure.js"), package()
    if client == "octave":
        return ("octave-cli", "--no-gui", "--quiet", "--norc", "websocket_client.m"), HERE
    folder = Path(tempfile.mkdtemp(prefix="frictus-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    program, source = folder / "client", HERE / "websocket_client.c"
    options = ("-std=c99", "-O2", f"-I{HEADERS}", str(source), "-lm", "-o", str(program))
    run("cc", *options, folder=folder)
    return (str(program),), folder


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=30)
    parser.add_argument("--client", choices=CLIENTS, default="node")
    given = parser.parse_args()
    command, folder = prepared(given.client)
    # A busy machine may hold the rig up: then that shows in the figures, and it goes on.
    config = config_of(limits=Limits(freeze_ms=5_000, missed_deadlines=1_000))
    with serving(config, ("rig", "api", "recorder")) as supervisor:
        api = psutil.Process(supervisor.pid_of("api"))
        api.cpu_percent()
        told = run(
            *command,
            folder=folder,
            FRICTUS_PORT=str(config.api.port),
            FRICTUS_URL=f"ws://127.0.0.1:{config.api.port}",
            FRICTUS_SECONDS=str(given.seconds),
        )
        load, api_percent = os.getloadavg()[0], api.cpu_percent()
    figures, name = json.loads(told), CLIENTS[given.client]
    for what, count, lost, age in (
        ("samples of two streams", "samples", "lostSamples", "age_samples_ms"),
        ("states of the finger", "states", "lostStates", "age_finger_ms"),
    ):
        ages = " / ".join(f"{value:.1f}" for value in figures[age])
        sys.stdout.write(
            f"{HEAD if count == 'samples' else ''}"
            f"| {what} | {figures[count]} | {figures[lost]} | {ages} |\n"
        )
    sys.stdout.write(
        f"\n{figures['seconds']:g} s; {figures['cpu_percent']:.0f} % of a core for {name}, "
        f"{api_percent:.0f} % for the API; load {load:.1f} on {os.cpu_count()} cores.\n"
    )


if __name__ == "__main__":
    main()
