"""All figures, one after the other, with the machine they were measured on."""

import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from frictus_laboratory.benchmarks import (
    contention,
    delivery,
    discovery,
    identification,
    kernel,
    kills,
    lateness,
    occupancy,
    recording,
    start,
    throughput,
    update,
    viewers,
)
from frictus_laboratory.benchmarks.figure import SCHEMA, Figure


@dataclass(frozen=True, slots=True)
class BenchReport:
    """What `frictus bench` found.

    Attributes
    ----------
    figures : list of Figure
        Rows of the report.
    machine : dict
        What the figures hang on, the load average at beginning and end included.
    seconds : float
        How long it took.
    """

    figures: list[Figure]
    machine: dict[str, Any]
    seconds: float

    def fields(self) -> dict[str, Any]:
        """Return the report as plain data, for JSON."""
        return {
            "schema": SCHEMA,
            "version": version("frictus"),
            "seconds": round(self.seconds, 1),
            "machine": self.machine,
            "figures": [figure.fields() for figure in self.figures],
        }


MEASUREMENTS: dict[str, Callable[[], list[Figure]]] = {
    "kernel": kernel.measure,
    "throughput": throughput.measure,
    "block latency": delivery.measure,
    "texture update": update.measure,
    "start": start.measure,
    "rig on a core": occupancy.measure,
    "loop lateness": lateness.measure,
    "busy processes beside": contention.measure,
    "viewers": viewers.measure,
    "kills": kills.measure,
    "identification": identification.measure,
    "discovery": discovery.measure,
    "recording": recording.measure,
}


def measure(say: Callable[[str], None]) -> BenchReport:
    """Measure everything.

    Parameters
    ----------
    say : callable
        Told what is being measured.
    """
    machine = _machine()
    begun_s = time.monotonic()
    figures = []
    for number, (name, measurement) in enumerate(MEASUREMENTS.items(), 1):
        say(f"{number} of {len(MEASUREMENTS)}: {name}")
        figures += measurement()
    machine["load_average_after"] = _load_average()
    return BenchReport(figures, machine, time.monotonic() - begun_s)


def _machine() -> dict[str, Any]:
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "cpus": os.cpu_count(),
        "python": platform.python_version(),
        "numba": version("numba"),
        "zenoh": version("eclipse-zenoh"),
        "load_average_before": _load_average(),
    }


def _load_average() -> float | None:
    """Return how many processes wanted a CPU over the last minute, where the system tells."""
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None
