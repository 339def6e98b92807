"""A discovery of three steps, each of which waits until a file beside the studies allows it.

Run in processes that the service starts; the name of the study says what goes wrong.
"""

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from tests.service.discovery.found import discovery

from frictus_service.discovery.across_studies import page
from frictus_service.discovery.across_studies.document import AcrossStudies, StudyOutcome
from frictus_service.discovery.jobs import (
    DiscoveryProgress,
    DiscoveryResult,
    DiscoverySpec,
)
from frictus_service.discovery.report.findings import verdict_sentence
from frictus_service.discovery.report.page import write
from frictus_service.errors import DiscoveryCancelledError, StudyError
from frictus_service.synthesis.compensability import placeholder_model

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
        across = _across(studies)
        page.write(across, folder)
        return DiscoveryResult(verdict=None, sentence=across.sentence, causes=())
    found = discovery(np.random.default_rng(spec.seed))
    write(found, folder)
    return DiscoveryResult(
        verdict=found.verdict,
        sentence=verdict_sentence(found),
        causes=tuple(cause.id for cause in found.causes),
    )


def _across(studies: Sequence[Path]) -> AcrossStudies:
    return AcrossStudies(
        code_version="0.1.0",
        response="friction",
        base_model=placeholder_model(),
        sentence="Nothing is wrong in any of them.",
        causes=(),
        base_parameters=(),
        studies=tuple(
            StudyOutcome(
                name=study.stem,
                path=str(study),
                sha256="0" * 64,
                participants=6,
                trials=24,
                trials_used=24,
                held_out="participants",
                verdict="clean",
                causes=(),
                report=f"studies/{study.stem}/report.html",
            )
            for study in studies
        ),
        left_out=(),
    )
