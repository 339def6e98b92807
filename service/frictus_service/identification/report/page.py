"""The page of an identification in one HTML file, and what else it leaves behind."""

import json
import re
from collections import Counter
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from matplotlib.figure import Figure

from frictus.model import Model
from frictus_service.durable import replace_files
from frictus_service.errors import Exclusion
from frictus_service.identification.documents import (
    PARAMETERS,
    ConditionFit,
    EstimatedQuantity,
    Excluded,
    Identification,
    ParticipantResult,
    StudySummary,
    TrialCount,
    TrialNote,
)
from frictus_service.identification.fit.conditions import ObservationTable
from frictus_service.identification.inference.effects import Centre
from frictus_service.identification.inference.statistics import LEAST_FOR_FLIPS
from frictus_service.identification.models import (
    participant_models,
    population_model,
    why_no_population,
)
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.report.bode import bode, points_of
from frictus_service.identification.report.html import fill, number, picture
from frictus_service.identification.report.overview import boxes, correlation, effects, laws

NO_ROWS = "no response at its tones could be measured"
NOT_MEASURED = "nowhere in its condition are speed and normal force known"


def account_for(
    observations: Sequence[TrialObservations],
    table: ObservationTable,
    path: str,
    sha256: str,
    simulated: bool,
    unreadable: Sequence[Exclusion],
) -> StudySummary:
    """Return what is used of a study; a trial without a drive is counted, not excluded.

    Parameters
    ----------
    observations : sequence of TrialObservations
        Of all trials.
    table : ObservationTable
        What is used.
    path, sha256 : str
        Of the study.
    simulated : bool
        Whether it says that no finger was measured.
    unreadable : sequence of Exclusion
        Trials of which there are no observations.
    """
    used = {item.info.id for item in table.trials}
    excluded = [
        Excluded(trial=item.trial, reasons=(f"{item.field}: {item.reason}",))
        for item in unreadable
    ]
    excluded += [
        Excluded(
            trial=item.info.id,
            participant=item.info.participant,
            speed_mm_s=item.info.speed_mm_s,
            force_n=item.info.force_n,
            tones_hz=item.info.tones_hz,
            reasons=item.reasons or ((NOT_MEASURED if item.rows.tone_hz.size else NO_ROWS),),
        )
        for item in observations
        if not item.valid or (item.info.tones_hz and item.info.id not in used)
    ]
    return StudySummary(
        path=path,
        sha256=sha256,
        simulated=simulated,
        participants=len({item.info.participant for item in observations}),
        trials=len(observations) + len(unreadable),
        trials_used=len(table.trials),
        counts=_counts(observations, table),
        excluded=tuple(excluded),
        notes=tuple(
            TrialNote(trial=item.info.id, notes=item.notes)
            for item in table.trials
            if item.notes
        ),
    )


def _counts(
    observations: Sequence[TrialObservations], table: ObservationTable
) -> tuple[TrialCount, ...]:
    every = Counter(item.info.participant for item in observations)
    used = Counter(item.info.participant for item in table.trials)
    blank = Counter(item.info.participant for item in observations if not item.info.tones_hz)
    return tuple(
        TrialCount(
            participant=name, trials=every[name], used=used[name], without_drive=blank[name]
        )
        for name in sorted(every)
    )


MANY_LEFT_OUT = 0.2


def notes_on(
    study: StudySummary,
    conditions: Sequence[ConditionFit],
    participants: Sequence[ParticipantResult],
    centre: Centre,
) -> tuple[str, ...]:
    """Return sentences, the gravest first.

    Parameters
    ----------
    study : StudySummary
        Path, hash and counts.
    conditions : sequence of ConditionFit
        One entry each.
    participants : sequence of ParticipantResult
        One entry each.
    centre : Centre
        Speed and force at which effects are evaluated.
    """
    return tuple(
        [
            *_on_speeds(participants, centre),
            *_on_people(study, participants),
            *_on_conditions(study, conditions),
            *_on_laws(conditions, participants),
            *(
                f"{p.participant}: {p.friction.second_solution}."
                for p in participants
                if p.friction and p.friction.second_solution
            ),
        ]
    )


def _on_speeds(participants: Sequence[ParticipantResult], centre: Centre) -> list[str]:
    if "speed" not in centre.effects:
        return [
            f"One speed only ({centre.speed_mm_s:g} mm/s): there is no speed law. Gain and "
            "cutoff hold at this speed; measure at two speeds at least for a law."
        ]
    one = [p.participant for p in participants if p.friction and p.friction.law is None]
    return [f"No speed law of {', '.join(one)}: one speed only."] if one else []


def _on_people(study: StudySummary, participants: Sequence[ParticipantResult]) -> list[str]:
    out = []
    lost = sorted({c.participant for c in study.counts} - {p.participant for p in participants})
    if lost:
        out.append(f"Nothing of {', '.join(lost)} can be used: no valid trial.")
    n = len(participants)
    if n == 1:
        out.append(
            "One participant: intervals are of this person, from repeats; nothing is said of "
            "people in general."
        )
    elif n < LEAST_FOR_FLIPS:
        out.append(
            f"{n} participants: exact sign-flip tests need {LEAST_FOR_FLIPS} (with "
            f"{n} the smallest possible p is 1/{2 ** (n - 1)}); only t tests are given."
        )
    return out


def _on_conditions(study: StudySummary, conditions: Sequence[ConditionFit]) -> list[str]:
    out = []
    left_out = sum(bool(trial.tones_hz) for trial in study.excluded)
    driven = study.trials - sum(count.without_drive for count in study.counts)
    if driven and left_out > MANY_LEFT_OUT * driven:
        out.append(f"{left_out} of {driven} driven trials are not used.")
    if all(c.mobility is None for c in conditions):
        out.append(
            "No mobility: nothing that can be used says how the skin moves at enough tones up "
            "to its limit."
        )
    if all(c.friction is None for c in conditions):
        why = (each for c in conditions for each in c.missing if each.startswith("friction: "))
        reason = next(why, "friction: no condition has enough tones")
        out.append(f"No {reason.replace(':', ' response:', 1)}.")
    short = sum(1 for c in conditions if c.missing)
    if short:
        out.append(f"{short} of {len(conditions)} conditions lack a fit; reasons stand there.")
    far = sum(1 for c in conditions if c.outlier)
    if far:
        out.append(
            f"{far} of {len(conditions)} conditions lie far from their participant's others; "
            "they are used, and estimates without them stand beside."
        )
    return out


def _on_laws(
    conditions: Sequence[ConditionFit], participants: Sequence[ParticipantResult]
) -> list[str]:
    fitted = Counter(c.participant for c in conditions if c.friction is not None)
    through_two = [
        p.participant
        for p in participants
        if p.friction and p.friction.law and fitted[p.participant] == 2
    ]
    negative = [
        p.participant
        for p in participants
        if p.friction and p.friction.law and p.friction.law.cutoff_0_hz.value <= 0.0
    ]
    out = []
    if through_two:
        out.append(
            f"The speed law of {', '.join(through_two)} is a line through two conditions: how "
            "far conditions lie from it cannot be estimated, and the intervals of cutoff and "
            "slope of one person hold the noise of the trials alone. They are too narrow where "
            "the contact differs between conditions; measure a third speed or a second force."
        )
    if negative:
        out.append(
            f"The cutoff of {', '.join(negative)}, continued to rest, is not positive: their "
            "laws hold between the measured speeds and cannot be stored as models."
        )
    return out


EXAMPLE_SPEED_MM_S, EXAMPLE_FORCE_N = 40.0, 0.2
"""The paper's example; of each participant the condition next to it is drawn."""


def render(found: Identification, observations: Sequence[TrialObservations]) -> str:
    """Return the report as one HTML file with all figures in it.

    Parameters
    ----------
    found : Identification
        The document of an identification.
    observations : sequence of TrialObservations
        From which it was identified.
    """
    with_law = [p for p in found.participants if p.friction and p.friction.law]
    stiffness = [
        one for one in found.correlations if (one.first, one.second) == ("cutoff", "stiffness")
    ]
    return fill(
        resources.files(__package__).joinpath("page.html.j2"),
        {"interval": interval},
        found=found,
        study=found.study,
        with_law=with_law,
        laws=picture(laws(found)) if any(c.friction for c in found.conditions) else None,
        effects=_maybe(effects(found)),
        boxes=[
            (parameter, picture(figure))
            for parameter in PARAMETERS
            if (figure := boxes(found, parameter)) is not None
        ],
        bodes=_bodes(found, observations),
        correlation=picture(correlation(found, stiffness[0])) if stiffness else None,
        significant=[pair for pair in found.pairs if pair.p < 0.05],
        outliers=[c for c in found.conditions if c.outlier],
        missing=[c for c in found.conditions if c.missing],
    )


def _bodes(
    found: Identification, observations: Sequence[TrialObservations]
) -> list[tuple[ConditionFit, str]]:
    """Return a Bode plot of one condition of each participant."""
    out = []
    for person in found.participants:
        own = [
            c
            for c in found.conditions
            if c.participant == person.participant and c.friction is not None
        ]
        if not own or person.friction is None:
            continue
        chosen = min(
            own,
            key=lambda c: (
                abs(c.speed_mm_s - EXAMPLE_SPEED_MM_S),
                abs(c.force_n - EXAMPLE_FORCE_N),
            ),
        )
        points = points_of(observations, chosen)
        figure = bode(points, chosen, person, found.settings.mobility_highest_hz)
        out.append((chosen, picture(figure)))
    return out


def _maybe(figure: Figure | None) -> str | None:
    return None if figure is None else picture(figure)


def interval(estimate: EstimatedQuantity | None, factor: float = 1.0) -> str:
    """Return a value with its 95 % interval."""
    if estimate is None:
        return "-"
    value = number(factor * estimate.value)
    if estimate.ci95 is None:
        return value
    low, high = (number(factor * end) for end in estimate.ci95)
    return f"{value} [{low}, {high}]"


REPORT, DOCUMENT, MODELS = "report.html", "identification.json", "models"
NAMED = (
    "population-friction.json",
    "participant-*-friction.json",
    "participant-*-mobility.json",
)
"""Models that `named_models` names; whatever else lies beside them is not an earlier run's."""


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
    models = folder / MODELS
    models.mkdir(parents=True, exist_ok=True)
    contents = {
        folder / REPORT: render(found, observations).encode(),
        folder / DOCUMENT: found.to_json(),
    }
    for name, model in named_models(found):
        contents[models / f"{name}.json"] = _readable(model)
    replace_files(contents)
    for stale in (each for pattern in NAMED for each in models.glob(pattern)):
        if stale not in contents:
            stale.unlink()  # of an earlier run: its participant is no longer in the study
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
