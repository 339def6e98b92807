"""What a Node client gets of two raw 20 kHz streams and the finger over the WebSocket.

`uv run python bench/websocket.py --seconds 30` runs the service and `npm run measure` of
clients/typescript, and prints the table of `docs/websocket.md`. Needs Node and the registry of
npm.
"""

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Final

import psutil

sys.path.insert(0, str(Path(__file__).parents[1]))  # so that a script finds the tests
from tests.typescript.package import package, run

from frictus_laboratory.benchmarks.processes import config_of, serving

HEAD: Final = "| what | of how many | lost | age p50 / p99 / most, ms |\n|---|---|---|---|\n"


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=30)
    seconds = parser.parse_args().seconds
    folder = package()
    config = config_of()
    with serving(config, ("rig", "api", "recorder")) as supervisor:
        api = psutil.Process(supervisor.pid_of("api"))
        api.cpu_percent()
        told = run(
            "node",
            "--experimental-websocket",
            "build/test/measure.js",
            folder=folder,
            FRICTUS_URL=f"ws://127.0.0.1:{config.api.port}",
            FRICTUS_SECONDS=str(seconds),
        )
        load, api_percent = os.getloadavg()[0], api.cpu_percent()
    figures = json.loads(told)
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
        f"\n{figures['seconds']} s; {figures['cpu_percent']:.0f} % of a core for Node, "
        f"{api_percent:.0f} % for the API; load {load:.1f} on {os.cpu_count()} cores.\n"
    )


if __name__ == "__main__":
    main()
