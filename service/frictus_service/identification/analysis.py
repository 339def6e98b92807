"""From observations to an identification: fits, laws, statistics."""

from collections.abc import Sequence
from importlib.metadata import version
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.errors import Exclusion
from frictus_service.identification.documents import (
    EffectTest,
    Identification,
    Parameter,
    Settings,
    SweepResult,
)
from frictus_service.identification.fit.conditions import ObservationTable
from frictus_service.identification.fit.estimates import (
    Measured,
    cells_of,
    friction_of,
    mobility_of,
    values_of,
)
from frictus_service.identification.inference import effects, mixed_models
from frictus_service.identification.inference.correlations import correlations_of, outliers_of
from frictus_service.identification.inference.effects import (
    Centre,
    number,
    pairs_of,
    per_participant,
)
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.plausibility.finding import (
    Finding,
    leave_out,
    stop_if_implausible,
)
from frictus_service.identification.plausibility.judge import without_skin
from frictus_service.identification.report.overview import population_of
from frictus_service.identification.report.page import account_for, notes_on
from frictus_service.identification.report.results import (
    conditions_of,
    participants_of,
    sweeps_of,
)

NO_SKIN: Final = (
    "Nothing was fitted to the skin: what its sensor reports cannot be, as said below. "
    "Friction does not need it."
)


def identify(
    observations: Sequence[TrialObservations],
    *,
    path: str = "",
    sha256: str = "",
    simulated: bool = False,
    unreadable: Sequence[Exclusion] = (),
    findings: Sequence[Finding] = (),
    settings: Settings | None = None,
) -> Identification:
    """Identify friction and mobility of every condition and participant, and test effects.

    Parameters
    ----------
    observations : sequence of TrialObservations
        Of a whole study, in any order; invalid trials are listed, not used.
    path, sha256 : str
        Of the study.
    simulated : bool
        Whether the study says that no finger was measured.
    unreadable : sequence of Exclusion
        Trials of the study of which there are no observations.
    findings : sequence of Finding
        Of `judge_study`; those that stop raise, the others become notes. Where the skin's
        sensor alone stops, friction is identified, and the skin is not.
    settings : Settings or None

    Raises
    ------
    ImplausibleStudyError
        If a finding makes every fit nonsense.
    NothingToIdentifyError
        If no trial can be used.
    """
    stopped = any(each.severity == "stop" for each in findings)
    findings = without_skin(findings) if stopped else findings
    stop_if_implausible(findings, path)
    if stopped:  # by the skin's sensor, which friction does not need
        observations = [each.without_mobility() for each in observations]
    observations = leave_out(observations, findings)
    settings = settings or Settings()
    table = ObservationTable.of(observations)
    measured = Measured.of(table)
    centre = Centre.of(measured.target_mm_s.tolist(), measured.target_n.tolist())
    friction = friction_of(table, measured, settings)
    mobility = mobility_of(table, measured, settings)
    fits = {"friction": friction, "mobility": mobility}
    values = values_of(friction, mobility, len(table.conditions))
    outliers = outliers_of(values, measured, centre, settings.outlier_mads)
    participants = participants_of(table, measured, fits, outliers)
    summary = account_for(observations, table, path, sha256, simulated, unreadable)
    conditions = conditions_of(table, measured, fits, outliers, settings)
    sweeps: tuple[SweepResult, ...] = ()
    if settings.sweeps and friction is not None:
        sweeps = sweeps_of(table, measured, friction, settings)
    cells = {name: cells_of(measured, value) for name, value in values.items()}
    return Identification(
        code_version=version("frictus"),
        settings=settings,
        study=summary,
        conditions=conditions,
        sweeps=sweeps,
        participants=participants,
        population=population_of(participants),
        effects=_effects(values, outliers, measured, centre, settings),
        spreads=tuple(
            found
            for name, own in cells.items()
            if (found := mixed_models.people_differ(name, own, centre)) is not None
        ),
        pairs=tuple(pairs_of(values, measured)),
        correlations=tuple(correlations_of(values, measured, table.participants)),
        notes=(
            *((NO_SKIN,) if stopped else ()),
            *(f"{finding.text}." for finding in findings),
            *notes_on(summary, conditions, participants, centre),
        ),
    )


def _effects(
    values: dict[Parameter, FloatArray],
    outliers: dict[Parameter, BoolArray],
    measured: Measured,
    centre: Centre,
    settings: Settings,
) -> tuple[EffectTest, ...]:
    """Return the tests, beside each its value without outliers and by a mixed model."""
    n_people = int(measured.person.max()) + 1
    cells = {name: cells_of(measured, value) for name, value in values.items()}
    tests = effects.across_participants(
        cells, centre, n_people, np.random.default_rng(settings.seed)
    )
    checks = {}
    if settings.mixed_models and n_people > 1:
        checks = {
            name: mixed_models.cross_check(own, centre)
            for name, own in cells.items()
            if own.value.size > n_people + len(centre.effects)
        }
    out = []
    for test in tests:
        rest = None
        far = outliers[test.parameter]
        if far.any():
            kept = cells_of(measured, np.where(far, np.nan, values[test.parameter]))
            column = 1 + centre.effects.index(test.effect)
            found = per_participant(kept, centre, n_people)[:, column]
            rest = number(float(np.nanmean(found))) if np.isfinite(found).any() else None
        check = checks.get(test.parameter, {}).get(test.effect)
        out.append(test.model_copy(update={"without_outliers": rest, "mixed": check}))
    return tuple(out)
