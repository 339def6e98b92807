"""Parameters of named causes: as a document says them, and as a model accepts them."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import EFFECTS
from frictus_service.discovery.decision.decision import Decision
from frictus_service.discovery.decision.naming import CauseDecision
from frictus_service.discovery.document import ParameterEstimate, ParticipantValue
from frictus_service.discovery.inference.mode_fit import ShapeEstimate, shape_of
from frictus_service.discovery.inference.mode_shape import SHAPE
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.discovery.problem.problem import DiscoveryProblem


def parameters_of(
    problem: DiscoveryProblem, found: Decision, each: CauseDecision, units: Sequence[str]
) -> dict[str, ParameterEstimate]:
    """Return the parameters of a cause, with intervals where they are known.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    found : Decision
        The causes, with the model that has them.
    each : CauseDecision
        One that is in this model.
    units : sequence of str
        Names of the participants, or of the blocks of trials.
    """
    candidate = problem.candidates[each.candidate]
    effect = EFFECTS[candidate.effect]
    unit_of = {parameter.name: parameter.unit for parameter in effect.parameters}
    known = each.coefficients[np.isfinite(each.coefficients)]
    values = parameter_of(candidate, known)
    mean, n = float(values.mean()), values.size
    error = float(values.std(ddof=1) / np.sqrt(n))
    # What measuring is wrong by is the same for all: no mean takes it away.
    best = float(parameter_of(candidate, found.accuracy[each.candidate]))
    half = float(np.hypot(stats.t.ppf(0.975, n - 1) * error, best / 2.0))
    least = 0.0 if candidate.positive else -np.inf
    estimate = ParameterEstimate(
        value=max(mean, least),
        ci95=(max(mean - half, least), max(mean + half, least)),
        unit=unit_of[candidate.parameter],
        standard_error=error,
        per_participant=tuple(
            ParticipantValue(
                participant=unit, value=float(parameter_of(candidate, coefficient))
            )
            for unit, coefficient in zip(units, each.coefficients, strict=True)
            if np.isfinite(coefficient)
        ),
    )
    parameters = {candidate.parameter: estimate}
    for name, held in candidate.held:
        parameters[name] = ParameterEstimate(value=held, ci95=None, unit=unit_of[name])
    if candidate.effect == "second_mode":
        shape = shape_of(problem, found.extended, each.candidate)
        return _with_mode_intervals(parameters, candidate.parameter, shape)
    return parameters


def parameter_of(candidate: Candidate, coefficient: FloatArray | float) -> FloatArray:
    """Return the parameter itself; below 0 where its square came out so.

    Parameters
    ----------
    candidate : Candidate
        The cause.
    coefficient : ndarray or float
        Of its signature: the parameter, or its square.
    """
    value = np.asarray(coefficient, dtype=np.float64)
    return np.sign(value) * np.sqrt(np.abs(value)) if candidate.squared else value


def _with_mode_intervals(
    found: Mapping[str, ParameterEstimate], dose: str, shape: ShapeEstimate
) -> dict[str, ParameterEstimate]:
    """Return the parameters of a mode with the intervals that its fit gives.

    Found is the interval of the share, the dose, of a mode of known shape.
    """
    parameters = dict(found)
    for name, half in zip(SHAPE, shape.half_widths, strict=True):
        value = found[name].value
        ends = (value * float(np.exp(-half)), value * float(np.exp(half)))
        parameters[name] = found[name].model_copy(update={"ci95": ends})
    share = found[dose]
    if share.ci95 is not None:
        low, high = share.ci95
        half = float(np.hypot((high - low) / 2.0, shape.share_half_width))
        middle = (low + high) / 2.0
        wider = {"ci95": (middle - half, middle + half)}
        parameters[dose] = share.model_copy(update=wider)
    return parameters


def accepted(candidate: Candidate, found: Mapping[str, ParameterEstimate]) -> dict[str, float]:
    """Return the parameters of a cause as a model accepts them.

    Parameters
    ----------
    candidate : Candidate
        The cause.
    found : mapping of str to ParameterEstimate
        From `parameters_of`.
    """
    bounds = {p.name: (p.low, p.high) for p in EFFECTS[candidate.effect].parameters}
    return {
        name: float(np.clip(estimate.value, *bounds[name])) for name, estimate in found.items()
    }


def notes_on_bounds(candidate: Candidate, found: Mapping[str, ParameterEstimate]) -> list[str]:
    """Return the notes on parameters that no model accepts as they were found.

    Parameters
    ----------
    candidate : Candidate
        The cause.
    found : mapping of str to ParameterEstimate
        From `parameters_of`.
    """
    return [
        f"{candidate.effect}: {name} is found at {found[name].value:.4g}, beyond what a model "
        f"accepts: the extended model has {limited:.4g}, and was measured with that."
        for name, limited in accepted(candidate, found).items()
        if limited != found[name].value
    ]
