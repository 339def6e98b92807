"""Work of every kind of job that does the same: it waits for a file in the folder of the job.

Run in processes that the engines start. Each start adds a line to ``starts``, so that a test
sees that the work is under way, and how often it was begun.
"""

import os
import queue
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import frictus
from frictus.experiment import Protocol
from frictus.model import FirstOrderSpeedLaw, Model
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress
from frictus_service.discovery.jobs import DiscoveryProgress, DiscoveryResult, DiscoverySpec
from frictus_service.errors import (
    CancelledError,
    DiscoveryCancelledError,
    ExperimentCancelledError,
)
from frictus_service.experiments.job import ExperimentJob, Input, ParticipantScreen

GO = "go"
STARTS = "starts"


def _wait(folder: Path, cancelled: Callable[[], bool], error: type[Exception]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / STARTS).open("a", encoding="ascii") as starts:
        starts.write(f"{os.getpid()}\n")
    while not (folder / GO).exists():
        if cancelled():
            raise error("cancelled")
        time.sleep(0.005)


def calibrate(
    spec: CalibrationSpec,
    folder: Path,
    client: frictus.Client,
    site: str,
    tell: Callable[[Progress], None],
    cancelled: Callable[[], bool],
) -> CalibrationResult:
    """Wait, as a calibration."""
    tell(
        Progress(
            phase="record", trials_done=0, trials_planned=1, trials_rejected=0, recorded_s=0.0
        )
    )
    _wait(folder, cancelled, CancelledError)
    law = FirstOrderSpeedLaw(gain_n=0.4, cutoff_0_hz=400.0, slope_hz_per_mm_s=12.0)
    return CalibrationResult(
        model=Model(base=law), study="s.h5", recorded_s=1.0, precision=0.03, reached=True
    )


def discover(
    spec: DiscoverySpec,
    studies: Sequence[Path],
    folder: Path,
    tell: Callable[[DiscoveryProgress], None],
    cancelled: Callable[[], bool],
) -> DiscoveryResult:
    """Wait, as a discovery."""
    tell(DiscoveryProgress(message="waiting"))
    _wait(folder, cancelled, DiscoveryCancelledError)
    return DiscoveryResult(verdict=None, sentence="", causes=())


def present(
    job: ExperimentJob,
    protocol: Protocol,
    folder: Path,
    client: frictus.Client,
    site: str,
    inputs: "queue.SimpleQueue[Input]",
    tell: Callable[[ParticipantScreen], None],
    cancelled: Callable[[], bool],
) -> None:
    """Wait, as an experiment."""
    tell(ParticipantScreen(phase="ready", trial=1))
    _wait(folder, cancelled, ExperimentCancelledError)
