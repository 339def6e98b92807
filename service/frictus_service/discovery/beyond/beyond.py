"""What is said of what no cause explains: a form, or a smooth discrepancy, or nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import extended
from frictus_service.discovery.beyond.characterise import (
    RESPONSE,
    Characterised,
    characterise,
    interval_of_mean,
)
from frictus_service.discovery.beyond.form_fit import Remainder
from frictus_service.discovery.beyond.smooth import COVARIATES, SmoothDiscrepancy, fit_smooth
from frictus_service.discovery.decision.decision import CLEARLY_BETTER, Decision
from frictus_service.discovery.inference.linearisation import Linearised, misfit
from frictus_service.discovery.problem.problem import DiscoveryProblem


@dataclass(frozen=True)
class Beyond:
    """What lies beyond the catalogue.

    Attributes
    ----------
    problem : DiscoveryProblem
        With the form, or the smooth discrepancy, in its base model.
    form : Characterised or None
        None where none may be named.
    smooth : SmoothDiscrepancy or None
        None where nothing is left of the response.
    """

    problem: DiscoveryProblem
    form: Characterised | None = None
    smooth: SmoothDiscrepancy | None = None

    @property
    def smooth_in_model(self) -> bool:
        """Whether the smooth discrepancy predicts where no form does."""
        return (
            self.form is None
            and self.smooth is not None
            and interval_of_mean(self.smooth.gain)[0] > 0.0
        )

    @property
    def effect(self) -> tuple[str, Mapping[str, float]] | None:
        """The effect that enters the extended model."""
        if self.form is not None:
            return self.form.fitted.form.id, self.form.fitted.values
        if self.smooth is not None and self.smooth_in_model:
            return self.smooth.effect, self.smooth.values
        return None


def look_beyond(problem: DiscoveryProblem, found: Decision, flips: FloatArray) -> Beyond:
    """Return what describes what the causes of a decision leave.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    found : Decision
        About the base model.
    flips : ndarray, shape (n_flips, n_units)
    """
    located = [each for each in found.unexplained if each.pattern.channel in RESPONSE]
    if problem.response != "friction" or not located:
        return Beyond(problem)
    smooth = _smooth(problem, found.extended, [each.pattern.covariate for each in located])
    form = _form(problem, found, flips)
    beyond = Beyond(problem, form, smooth)
    if beyond.effect is None:
        return beyond
    base = extended(problem.base, [beyond.effect])
    return replace(beyond, problem=replace(problem, base=base))


def _form(
    problem: DiscoveryProblem, found: Decision, flips: FloatArray
) -> Characterised | None:
    """Return the form beside the causes, or one that alone explains as much as they and it.

    A power law and what bends it back below a threshold are together what bends above it: that
    is the simpler thing to say.
    """
    beside = characterise(problem, found.extended, found.unexplained, flips)
    if not found.effects:
        return beside
    alone = characterise(problem, found.base, found.unexplained, flips)
    if alone is None:
        return beside
    ruler = found.extended
    most = (
        misfit(problem, ruler, ruler) - CLEARLY_BETTER
        if beside is None
        else misfit(beside.problem, beside.model, ruler) + CLEARLY_BETTER
    )
    return alone if misfit(alone.problem, alone.model, ruler) <= most else beside


def beside_form(first: Decision, found: Decision) -> Decision:
    """Return what was found beside a form, with the causes of which it is the shape.

    Parameters
    ----------
    first : Decision
        Without the form: a cause of which only another shape explains the data keeps its name.
    found : Decision
        Beside the form.
    """
    there = {each.candidate for each in found.named}
    kept = [each for each in first.named if not each.in_model and each.candidate not in there]
    return replace(found, named=(*found.named, *kept))


def _smooth(
    problem: DiscoveryProblem, model: Linearised, covariates: Sequence[str]
) -> SmoothDiscrepancy | None:
    """Return the smooth discrepancy by whichever located covariate predicts best."""
    remainder = Remainder.of(problem, model)
    known = [each for each in dict.fromkeys(covariates) if each in COVARIATES]
    fitted = [fit_smooth(remainder, each) for each in known]
    return max(fitted, key=lambda each: float(each.gain.sum()), default=None)
