"""A discovery as the process of a job carries it out."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from frictus_service.discovery.errors import DiscoveryCancelledError
from frictus_service.discovery.jobs.documents import (
    DiscoveryProgress,
    DiscoveryResult,
    DiscoverySpec,
)
from frictus_service.durable import replace_file

BASE: Final = "base_model.json"
OBSERVATIONS: Final = "observations"
"""Beside the folders of all discoveries: by content, so that each trial is read once."""


def carry_out(
    spec: DiscoverySpec,
    study: Path,
    folder: Path,
    tell: Callable[[DiscoveryProgress], None],
    cancelled: Callable[[], bool],
) -> DiscoveryResult:
    """Carry out a discovery; its report lies in `folder` then.

    Parameters
    ----------
    spec : DiscoverySpec
        What the discovery was asked for.
    study : Path
        The file that it names.
    folder : Path
        Of this discovery alone.
    tell : callable
        Told what it is at.
    cancelled : callable
        Asked whenever something is told.

    Raises
    ------
    DiscoveryCancelledError
    """
    from frictus_service.discovery.report import files
    from frictus_service.discovery.report.phrasing import verdict_sentence
    from frictus_service.discovery.run import discover_study

    def told(line: str) -> None:
        if cancelled():
            raise DiscoveryCancelledError("cancelled; there is no report")
        tell(DiscoveryProgress(message=line))

    found = discover_study(
        study,
        response=spec.response,
        base=_base(spec, folder),
        seed=spec.seed,
        cache=folder.parent / OBSERVATIONS,
        tell=told,
    )
    told("writing the report")
    files.write(found, folder)
    return DiscoveryResult(
        verdict=found.verdict,
        sentence=verdict_sentence(found),
        causes=tuple(cause.id for cause in found.causes),
    )


def _base(spec: DiscoverySpec, folder: Path) -> str:
    if isinstance(spec.base, str):
        return spec.base
    kept = folder / BASE
    replace_file(kept, spec.base.to_json())
    return str(kept)
