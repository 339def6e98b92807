"""A discovery of three steps, each of which waits until a file beside the studies allows it.

Run in processes that the service starts; the name of the study says what goes wrong.
"""

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from tests.service.discovery.found import across, discovery

from frictus_service.discovery.across_studies import page
from frictus_service.discovery.jobs import (
    DiscoveryProgress,
    DiscoveryResult,
    DiscoverySpec,
)
from frictus_service.discovery.report.findings import verdict_sentence
from frictus_service.discovery.report.page import write
from frictus_service.errors import DiscoveryCancelledError, StudyError

STEPS = 3


def allow(studies: Path, steps: int) -> None:
    """Let discoveries below `studies` do so many steps."""
    beside = studies / "allowed.new"
    beside.write_text(str(steps), encoding="ascii")
    os.replace(beside, studies / "allowed")


def run(
    spec: DiscoverySpec,
    studies: Sequence[Path],
    folder: Path,
    tell: Callable[[DiscoveryProgress], None],
    cancelled: Callable[[], bool],
) -> DiscoveryResult:
    """Do the steps."""
    print("libraries print too")  # noqa: T201
    study = studies[0]
    allowed = study.parent / "allowed"
    for step in range(STEPS):
        tell(DiscoveryProgress(message=f"step {step}"))
        while int(allowed.read_text("ascii")) <= step:
            if cancelled():
                raise DiscoveryCancelledError("cancelled")
            time.sleep(0.005)
    if study.stem == "bad":
        raise StudyError("trial 7 has no position")
    if study.stem == "fatal":
        os._exit(11)
    if len(studies) > 1:
        together = across([each.stem for each in studies])
        page.write(together, folder)
        return DiscoveryResult(verdict=None, sentence=together.sentence, causes=())
    found = discovery(np.random.default_rng(spec.seed))
    write(found, folder)
    return DiscoveryResult(
        verdict=found.verdict,
        sentence=verdict_sentence(found),
        causes=tuple(cause.id for cause in found.causes),
    )
