"""What an identification leaves behind: report, JSON, and models that can be published."""

import json
import re
from collections.abc import Sequence
from pathlib import Path

from frictus.model import Model
from frictus_service.durable import replace_file
from frictus_service.identification.documents import Identification
from frictus_service.identification.models import (
    participant_models,
    population_model,
    why_no_population,
)
from frictus_service.identification.observation.observations import TrialObservations

REPORT, DOCUMENT, MODELS = "report.html", "identification.json", "models"


def write(
    found: Identification, observations: Sequence[TrialObservations], folder: Path
) -> list[Path]:
    """Write report, document and models, over what stands there; return their paths.

    Parameters
    ----------
    found : Identification
        The document of an identification.
    observations : sequence of TrialObservations
        From which it was identified.
    folder : Path
        Made where it is missing.
    """
    from frictus_service.identification.report.page import render

    models = folder / MODELS
    models.mkdir(parents=True, exist_ok=True)
    contents = {
        folder / REPORT: render(found, observations).encode(),
        folder / DOCUMENT: found.to_json(),
    }
    for name, model in named_models(found):
        contents[models / f"{name}.json"] = _readable(model)
    for stale in models.glob("*.json"):
        if stale not in contents:
            stale.unlink()  # of an earlier run: its participant is no longer in the study
    for path, content in contents.items():
        replace_file(path, content)
    return list(contents)


def named_models(found: Identification) -> list[tuple[str, Model]]:
    """Return all models, each with a plain name of its own; pseudonyms may be anything.

    Parameters
    ----------
    found : Identification
        The document of an identification.
    """
    out: list[tuple[str, Model]] = []
    if why_no_population(found) is None:
        out.append(("population-friction", population_model(found)))
    for model in participant_models(found):
        plain = re.sub(r"[^A-Za-z0-9._-]", "_", model.participant or "")
        name, again = f"participant-{plain}-{model.response}", 2
        while any(name == other for other, _ in out):
            name = f"participant-{plain}-{again}-{model.response}"
            again += 1
        out.append((name, model))
    return out


def _readable(model: Model) -> bytes:
    return json.dumps(json.loads(model.to_json()), indent=2).encode()
