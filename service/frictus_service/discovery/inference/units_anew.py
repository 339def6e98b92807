"""Units about a fitted model anew: as designed, if people were alike, or reweighted."""

from collections.abc import Sequence
from dataclasses import replace

from frictus_service.discovery.evidence.evidence_rows import as_asked
from frictus_service.discovery.evidence.residuals import Layout
from frictus_service.discovery.inference.covariance import Whitening
from frictus_service.discovery.inference.linear_model import Unit
from frictus_service.discovery.inference.linearisation import Linearised, units_about
from frictus_service.discovery.problem.candidates import Pattern
from frictus_service.discovery.problem.problem import DiscoveryProblem, UnwhitenedUnit


def as_designed(problem: DiscoveryProblem, model: Linearised) -> tuple[Unit, ...]:
    """Return the units as the design alone makes them.

    Fingers move as they were asked to, and are the same in every condition. What speeds
    that wander within a trial tell besides rests on the form of a law being exact.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised

    Returns
    -------
    tuple of Unit
        Without patterns.
    """
    asked = replace(problem, subjects=tuple(as_asked(subject) for subject in problem.subjects))
    return _again(asked, model, (), deviating=False).units


def if_alike(problem: DiscoveryProblem, model: Linearised) -> Linearised:
    """Return a model whose units are as they were if people did not differ in its causes.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    """
    return _again(problem, model, problem.patterns, deviating=True)


def weighted_as(
    problem: DiscoveryProblem, model: Linearised, ruler: Linearised, wanted: Sequence[int]
) -> tuple[Unit, ...]:
    """Return the units about a model, weighted as those about another.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model.
    ruler : Linearised
        The same for all models that are compared.
    wanted : sequence of int
        Candidates whose signatures the units have.
    """

    def whitened(_: Sequence[Layout], raws: Sequence[UnwhitenedUnit]) -> list[Whitening]:
        return list(ruler.whitenings)

    chosen, at = model.chosen, model.coefficients
    return units_about(problem, model.own, chosen, at, len(chosen), wanted, (), whitened)[0]


def _again(
    problem: DiscoveryProblem,
    model: Linearised,
    patterns: Sequence[Pattern],
    *,
    deviating: bool,
) -> Linearised:
    """Return the model with its units taken anew, weighted as they were."""

    def whitened(_: Sequence[Layout], raws: Sequence[UnwhitenedUnit]) -> list[Whitening]:
        return [
            Whitening.of(raw, each.weight, each.deviation * deviating)
            for raw, each in zip(raws, model.whitenings, strict=True)
        ]

    wanted = range(len(problem.candidates))
    chosen, at = model.chosen, model.coefficients
    units, whitenings = units_about(
        problem, model.own, chosen, at, len(chosen), wanted, patterns, whitened
    )
    return replace(model, units=units, whitenings=whitenings)
