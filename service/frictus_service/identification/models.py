"""From an identification to models that can be published."""

from collections.abc import Sequence
from typing import Any

from frictus.model import (
    Covariance,
    FirstOrderSpeedLaw,
    MassSpringDamper,
    Model,
    Validity,
)
from frictus_service.errors import NoModelError
from frictus_service.identification.documents import (
    CovarianceResult,
    Identification,
    LawResult,
    MobilityResult,
    ParticipantResult,
    Population,
)


def participant_models(identification: Identification) -> list[Model]:
    """Return the friction and mobility models of every participant who has them.

    Who has no speed law, or one whose cutoff is not positive at rest, has no friction model;
    the identification's notes say so.

    Parameters
    ----------
    identification : Identification
        The document of an identification.
    """
    out = []
    for person in identification.participants:
        told = _provenance(identification) | {"conditions": person.conditions}
        friction, mobility = person.friction, person.mobility
        if friction is not None and friction.law is not None and _storable(friction.law):
            told_of_law: dict[str, Any] = {"degrees_of_freedom": friction.degrees_of_freedom}
            if friction.second_solution is not None:
                told_of_law["second_solution"] = friction.second_solution
            out.append(_friction(person, friction.law, told | told_of_law))
        if mobility is not None:
            out.append(_mobility(person, mobility, told))
    return out


def population_model(identification: Identification) -> Model:
    """Return the friction model of the population: the means across participants.

    Its covariance is that of the means; how much people differ stands in the provenance.

    Parameters
    ----------
    identification : Identification

    Raises
    ------
    NoModelError
        If there are fewer than two participants with a speed law, or the mean cutoff is not
        positive at rest.
    """
    population, why_not = identification.population, why_no_population(identification)
    if why_not is not None:
        raise NoModelError(why_not)
    assert population is not None
    assert population.covariance is not None
    means = {value.name: value.mean.value for value in population.values}
    averaged = [
        person
        for person in identification.participants
        if person.friction is not None and person.friction.law is not None
    ]
    told = _provenance(identification) | {
        "participants": len(averaged),
        "between_participants_sd": _spread(population),
    }
    return Model(
        base=FirstOrderSpeedLaw(
            gain_n=means["gain_n"],
            cutoff_0_hz=means["cutoff_0_hz"],
            slope_hz_per_mm_s=means["slope_hz_per_mm_s"],
        ),
        skew_s=means["skew_s"],
        validity=_validity(averaged),
        covariance=_covariance(population.covariance),
        provenance=told,
    )


def why_no_population(identification: Identification) -> str | None:
    """Return why there is no population model; None where there is one.

    Parameters
    ----------
    identification : Identification
        The document of an identification.
    """
    population = identification.population
    if population is None or population.covariance is None:
        return (
            "no population model: it needs two participants with a speed law at least; use the "
            "participants' own models"
        )
    means = {value.name: value.mean.value for value in population.values}
    if not means["cutoff_0_hz"] > 0.0:
        return (
            f"no population model: the mean cutoff at rest is {means['cutoff_0_hz']:.0f} Hz; "
            "accepted: positive"
        )
    return None


def _friction(person: ParticipantResult, law: LawResult, told: dict[str, Any]) -> Model:
    return Model(
        base=FirstOrderSpeedLaw(
            gain_n=law.gain_n.value,
            cutoff_0_hz=law.cutoff_0_hz.value,
            slope_hz_per_mm_s=law.slope_hz_per_mm_s.value,
        ),
        skew_s=law.delay_s.value,
        validity=_validity([person]),
        covariance=_covariance(law.covariance),
        participant=person.participant,
        provenance=told,
    )


def _mobility(
    person: ParticipantResult, mobility: MobilityResult, told: dict[str, Any]
) -> Model:
    return Model(
        response="mobility",
        base=MassSpringDamper(
            mass_kg=mobility.mass_kg.value,
            damping_n_s_m=mobility.damping_n_s_m.value,
            stiffness_n_m=mobility.stiffness_n_m.value,
        ),
        skew_s=mobility.delay_s.value,
        validity=_validity([person]),
        covariance=_covariance(mobility.covariance),
        participant=person.participant,
        provenance=told,
    )


def _storable(law: LawResult) -> bool:
    return law.cutoff_0_hz.value > 0.0


def _covariance(found: CovarianceResult) -> Covariance:
    return Covariance(
        parameters=list(found.parameters), matrix=[list(row) for row in found.matrix]
    )


def _validity(participants: Sequence[ParticipantResult]) -> Validity:
    """Return what was measured, of all participants together."""

    def span(name: str) -> tuple[float, float]:
        ranges = [getattr(person, name) for person in participants]
        return min(low for low, _ in ranges), max(high for _, high in ranges)

    return Validity(
        speed_mm_s=span("speed_range_mm_s"),
        normal_force_n=span("force_range_n"),
        drive_vpp=span("drive_range_vpp"),
    )


def _spread(population: Population) -> dict[str, float]:
    return {value.name: value.between_sd for value in population.values}


def _provenance(identification: Identification) -> dict[str, Any]:
    study = identification.study
    told: dict[str, Any] = {
        "code_version": identification.code_version,
        "settings": identification.settings.model_dump(),
        "seed": identification.settings.seed,
        "trials_used": study.trials_used,
        "simulated": study.simulated,
    }
    if study.sha256:
        return told | {"study_sha256": study.sha256}
    return told | {"source": "observations that were not read from a study file"}
