"""A service whose recorder records a simulated rig, and what its tests wait for and read."""

import queue
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import frictus
from frictus.keys import Topics
from frictus.messages import RecordingState
from frictus_service.config import Config
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.samples import Samples
from frictus_service.recording.summary import RecordingSummary, summarise

SECRET = "a-token-that-must-not-leak"


def until(
    rig: frictus.Rig, holds: Callable[[RecordingState], bool], timeout_s: float = 60.0
) -> RecordingState:
    """Return the first state of the recorder for which something holds."""
    with rig.watch(Topics.RECORDING, timeout_s=timeout_s) as states:
        for state in states:
            assert isinstance(state, RecordingState)
            if holds(state):
                return state
    raise AssertionError("the feed has ended")


def summary_of(path: Path) -> RecordingSummary:
    with RecordingReader(path) as reader:
        return summarise(reader)


@dataclass(frozen=True)
class Service:
    config: Config
    supervisor: Supervisor
    said: "queue.Queue[str]"

    def wait_for(self, words: str) -> str:
        while words not in (line := self.said.get(timeout=60.0)):
            pass
        return line


def samples_of(reader: RecordingReader) -> list[Samples]:
    return [item for item in reader.items() if isinstance(item, Samples)]
