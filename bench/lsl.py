"""What an inlet of Lab Streaming Layer gets of a running rig.

`uv run python bench/lsl.py --seconds 30` runs the service with a simulated rig and `frictus
lsl`, takes force, acceleration and the finger in this process, and prints the table of
`docs/bridges.md`. What was lost on the way is NaN in the stream, or a step of its stamps.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil

from frictus_laboratory.benchmarks.processes import config_of, serving

OUTLETS: Final = ("force", "accel", "finger")
COMMAND: Final = "from frictus_service.cli import main; main()"
ALONE: Final = (
    "[multicast]\nResolveScope = machine\n[lab]\nSessionID = frictus-bench\n[log]\nlevel = -3\n"
)
"""Keeps LSL to this machine, and to this measurement."""
HEAD: Final = "| outlet | samples | missing | age p50 / p99 / most, ms |\n|---|---|---|---|\n"


class Pulled:
    """What came of an outlet."""

    def __init__(self, inlet: Any) -> None:
        self.inlet = inlet
        self.samples = self.empty = 0
        self.stamps: list[float] = []
        self.ages_s: list[float] = []

    def pull(self, now_s: float) -> None:
        """Take what has come."""
        rows, stamps = self.inlet.pull_chunk(timeout=0.0, max_samples=20_000)
        if len(stamps) == 0:
            return
        self.samples += len(stamps)
        self.empty += int(np.isnan(np.asarray(rows, np.float64)).any(axis=1).sum())
        self.stamps += list(stamps)
        self.ages_s.append(now_s - stamps[-1])

    def row(self, name: str) -> str:
        """Return its row of the table."""
        steps = np.diff(self.stamps)
        assert np.all(steps > 0.0), name
        missing = self.empty + int(np.sum(np.rint(steps / np.median(steps)) - 1.0))
        ages_ms = 1e3 * np.quantile(self.ages_s, [0.5, 0.99, 1.0])
        told = " / ".join(f"{age:.1f}" for age in ages_ms)
        return f"| {name} | {self.samples} | {missing} | {told} |\n"


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0)
    seconds = parser.parse_args().seconds
    config = config_of()
    command = [sys.executable, "-c", COMMAND, "lsl", "--rig", config.rig]
    command += ["--router", config.router.endpoint]
    with tempfile.TemporaryDirectory(prefix="frictus-") as folder:
        file = Path(folder) / "lsl_api.cfg"
        file.write_text(ALONE, encoding="utf-8")
        os.environ["LSLAPICFG"] = str(file)
        import pylsl  # reads where to look as it is loaded

        with (
            serving(config, ("rig",)),
            subprocess.Popen(command, stdout=subprocess.DEVNULL) as bridge,
        ):
            came = {}
            for name in OUTLETS:
                (found,) = pylsl.resolve_byprop("name", f"{config.rig}-{name}", 1, 60.0)
                came[name] = Pulled(pylsl.StreamInlet(found, max_buflen=60))
                came[name].inlet.open_stream(20.0)
            for one in came.values():
                one.inlet.flush()  # what came while the others were opened
            process = psutil.Process(bridge.pid)
            process.cpu_percent()
            end_s = time.monotonic() + seconds
            while time.monotonic() < end_s:
                for one in came.values():
                    one.pull(pylsl.local_clock())
                time.sleep(0.002)
            percent, load = process.cpu_percent(), os.getloadavg()[0]
            bridge.kill()
    sys.stdout.write(HEAD + "".join(one.row(name) for name, one in came.items()))
    sys.stdout.write(
        f"\n{seconds:g} s; {percent:.0f} % of a core for the bridge; load {load:.1f} on "
        f"{os.cpu_count()} cores.\n"
    )


if __name__ == "__main__":
    main()
