"""What a reader must know first: alternative forms of causes, and what could not be tested."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.decision.trial_accounting import account_for
from frictus_service.discovery.evidence.evidence_rows import Subject
from frictus_service.discovery.evidence.observation_table import (
    LEAST_UNITS,
    ResponseName,
    UnitAssignment,
)
from frictus_service.discovery.evidence.residuals import Compared
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.discovery.inference.linear_model import Unit
from frictus_service.discovery.inference.linearisation import Linearised, columns_of
from frictus_service.discovery.problem.candidates import (
    Covariate,
    Pattern,
    Place,
    places_of,
    scaled,
)
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.discovery.projection import (
    ROUNDING,
    inverse_of,
    orthogonal_to,
    orthonormal,
)

FORMS: Final = 2
"""A signature times the covariate, and times its square: a saturating or a stepped effect is
made of these and the signature itself to nine tenths."""
MOST: Final = 0.5
"""Of a signature: patterns in no covariate have two thirds or more of one that is a function of
frequency, and a fifth or less of one that is not (own gain and cutoff taken out)."""
BESIDE: Final[tuple[Covariate, ...]] = ("speed", "force", "minutes")
"""What an effect may grow with besides."""


def place_of(units: Sequence[Unit], effect: int, patterns: Sequence[Pattern]) -> Place:
    """Return the family of patterns that comes closest to an effect's signature.

    It is the one that is alike in all conditions if that makes up most of it: beside
    everybody's own cutoff, another roll-off looks much as if it came with speed.

    Parameters
    ----------
    units : sequence of Unit
        Whitened readings and signatures of each participant or block.
    effect : int
        Number of the candidate.
    patterns : sequence of Pattern
        That any misfit may show as.
    """
    family = places_of(patterns)
    names = list(dict.fromkeys(family))
    explained, whole = np.zeros(len(names)), 0.0
    for unit in units:
        own = orthonormal(unit.own)
        signature = orthogonal_to(own, unit.effects[:, effect])
        whole += float(signature @ signature)
        for place, name in enumerate(names):
            columns = unit.generic[:, [each == name for each in family]]
            basis = orthonormal(orthogonal_to(own, columns))
            explained[place] += float(np.sum(np.square(basis.T @ signature)))
    best = names[int(np.argmax(explained))]
    anywhere: Place = (best[0], "none")
    if anywhere in names and explained[names.index(anywhere)] > MOST * whole:
        return anywhere
    return best


def other_forms(
    problem: DiscoveryProblem,
    model: Linearised,
    effect: int,
    covariate: Covariate,
    *,
    beside: bool,
) -> list[tuple[FloatArray, FloatArray]]:
    """Return an effect in other forms, whitened, and how accurate they are, of each unit.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    effect : int
        Number of the candidate.
    covariate : str
        That it depends on; ``none``: on the frequency alone.
    beside : bool
        Also in forms that grow with something else: speed, force or time.
    """
    others = [name for name in BESIDE if name != covariate] if beside else []

    def made(unit: int) -> list[Compared]:
        subject = problem.subjects[unit]
        own, at = model.own[unit], model.coefficients[unit]
        signature = problem.signature(subject, own, model.chosen, at, effect)
        rows, trials = _scale(subject, covariate)
        powers = [signature.times(rows**k, trials**k) for k in range(1, FORMS + 1)]
        return [*powers, *(signature.times(*_scale(subject, name)) for name in others)]

    return columns_of(problem, model, made)


def _scale(subject: Subject, covariate: Covariate) -> tuple[FloatArray, FloatArray]:
    """Return the covariate of each row and of each trial, from about -1 to 1."""
    if covariate == "none":
        octaves = np.log(subject.rows.tone_hz / 250.0) / np.log(8.0)
        return octaves, np.zeros(subject.measured.low.size)
    if covariate == "speed x force":
        parts = [_scale(subject, name) for name in ("speed", "force")]
        return parts[0][0] * parts[1][0], parts[0][1] * parts[1][1]
    return (
        scaled(covariate, subject.rows.circumstances),
        scaled(covariate, subject.trials.circumstances),
    )


def with_forms(
    units: Sequence[Unit], forms: Sequence[tuple[FloatArray, FloatArray]]
) -> list[Unit]:
    """Return units whose effects are the other forms of one."""
    return [
        unit.looking_for(columns, accuracy)
        for unit, (columns, accuracy) in zip(units, forms, strict=True)
    ]


def explained_by(
    units: Sequence[Unit], misfit: Sequence[FloatArray], columns: Sequence[FloatArray]
) -> float:
    """Return the share of a misfit that columns can make up, in square.

    Parameters
    ----------
    units : sequence of Unit
        What is their own is taken out of both.
    misfit : sequence of ndarray, shape (n,)
    columns : sequence of ndarray, shape (n, k)
        The coefficients are those of all units together.
    """
    n_columns = columns[0].shape[1]
    gram, along, whole = np.zeros((n_columns, n_columns)), np.zeros(n_columns), 0.0
    for unit, rest, each in zip(units, misfit, columns, strict=True):
        own = orthonormal(unit.own)
        rest, each = orthogonal_to(own, rest), orthogonal_to(own, each)
        gram = gram + each.T @ each
        along = along + each.T @ rest
        whole += float(rest @ rest)
    return float(along @ inverse_of(gram, ROUNDING) @ along) / whole if whole > 0.0 else 0.0


def caveats_on(
    evidence: Sequence[TrialEvidence],
    usable: Sequence[TrialEvidence],
    compared: Sequence[TrialEvidence],
    units: UnitAssignment,
    response: ResponseName,
) -> tuple[str, ...]:
    """Return the notes.

    Parameters
    ----------
    evidence, usable, compared : sequence of TrialEvidence
        All trials of the study, those that can be used, and those of people who are compared.
    units : UnitAssignment
        Which trial belongs to which unit.
    response : {'friction', 'mobility'}
    """
    return (
        *account_for(evidence, usable, compared, units, response),
        *_design(compared),
        *_units(compared, units),
    )


def _design(used: Sequence[TrialEvidence]) -> list[str]:
    infos = [one.observed.info for one in used]
    notes = []
    for name, levels in (
        ("speed", {info.speed_mm_s for info in infos}),
        ("force", {info.force_n for info in infos}),
    ):
        if len(levels) == 1:
            notes.append(
                f"All trials have one target {name}: nothing that depends on {name} can be "
                "named beyond what it varies within a trial."
            )
    return notes


def _units(used: Sequence[TrialEvidence], units: UnitAssignment) -> list[str]:
    people = len(set(units.participant))
    if len(units.names) >= LEAST_UNITS and units.held_out == "blocks":
        return [
            f"{people} participant{'s' if people > 1 else ''}, below {LEAST_UNITS}: blocks of "
            "their trials take the role of people. What is found holds for these people only."
        ]
    return []
