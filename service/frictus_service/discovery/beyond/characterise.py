"""Which form of the grammar describes what no cause explains, and whether that may be said.

Forms are screened as the catalogue is, each at every shape of its grid; the most promising
families are fitted, and chosen among, by people who were not fitted (cross-fitting): the gain
of a person never rests on a form, a shape or a size to which that person contributed. Of forms
that those people do not tell apart, the one that leaves least of all people is named, with
everybody's own parameters fitted beside it; the others stay rivals. The p
value is that of the largest of all forms and shapes over sign flips: corrected for all that was
searched, as far as people deviate symmetrically and independently.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import stats

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import FORMS, extended
from frictus_service.discovery.beyond.form_fit import FittedForm, Remainder, fit_form
from frictus_service.discovery.beyond.grammar import TIMES_MIN, Form, Held, grammar
from frictus_service.discovery.decision.prediction_gain import (
    OMNIBUS,
    find_unexplained,
)
from frictus_service.discovery.inference.linear_model import (
    Unit,
    held_out_gain,
    project_out,
)
from frictus_service.discovery.inference.linearisation import Linearised, linearise
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.discovery.problem.problem import DiscoveryProblem, as_accurate

FOLDS: Final = 4
PROMISING: Final = 5
"""Forms that are fitted, of those that the screen finds best."""
PENALTY: Final = 2.0
"""Sum of squares that a parameter must save where the same people choose and fit (AIC)."""
TURNS: Final = 8
"""In which own parameters and a form are fitted at most; a small form needs one or two."""
LEAST_SHARE: Final = 0.5
"""Of what is left reproducibly; a form that explains less describes something else."""
NEARER: Final = 0.4
"""Of what lies between two times at which a step is tried: it turns over as much at least."""
RESPONSE: Final = frozenset({"size", "phase"})
"""Channels in which the grammar's forms show."""


@dataclass(frozen=True)
class Characterised:
    """A form that describes what no cause explains.

    Attributes
    ----------
    fitted : FittedForm
        To all people.
    p_value : float
        Corrected for all forms and shapes.
    gain : ndarray, shape (n_units,)
        Nats by which each unit, held out, is more likely; the form chosen without it.
    share : float
        Of the reproducible remainder.
    rivals : tuple of Form
        Forms of other families that held-out people do not tell from it.
    problem : DiscoveryProblem
        The problem with the form in its base model.
    model : Linearised
        Fitted beside the form.
    """

    fitted: FittedForm
    p_value: float
    gain: FloatArray
    share: float
    rivals: tuple[Form, ...]
    problem: DiscoveryProblem
    model: Linearised


def interval_of_mean(values: FloatArray) -> tuple[float, float]:
    """Return the 95 % t interval of a mean over units."""
    half = float(stats.t.ppf(0.975, values.size - 1) * values.std(ddof=1))
    half /= float(np.sqrt(values.size))
    return float(values.mean()) - half, float(values.mean()) + half


def characterise(
    problem: DiscoveryProblem,
    model: Linearised,
    flips: FloatArray,
    *,
    shown: bool = False,
) -> Characterised | None:
    """Return the form that describes what a model leaves; None where none may be named.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        Fitted with the causes that were named, and the units about it.
    flips : ndarray, shape (n_flips, n_units)
    shown : bool
        Whether it is shown already that the model leaves something, so that p need not tell.
    """
    if problem.response != "friction":
        return None
    screen = _Screen.of(problem, model)
    p_value = screen.p_value(flips)
    if not (shown or p_value <= max(OMNIBUS, 2.0 / len(flips))):
        return None
    remainder = Remainder.of(problem, model)
    compared = _compare(remainder, screen)
    if interval_of_mean(compared.honest)[0] <= 0.0:
        return None
    named = _named(problem, model, remainder, screen, compared.gaining())
    if named is None:
        return None
    fitted, beside = named
    left = find_unexplained(
        beside[0], beside[1], [u.beyond(model.chosen) for u in beside[1].units], flips
    )
    rest = sum(float(each.gain.sum()) for each in left if each.pattern.channel in RESPONSE)
    gained = float(compared.honest.sum())
    share = gained / (gained + rest)
    if share < LEAST_SHARE:
        return None
    rivals = compared.rivals(fitted.form)
    return Characterised(fitted, p_value, compared.honest, share, rivals, *beside)


def _named(
    problem: DiscoveryProblem,
    model: Linearised,
    remainder: Remainder,
    screen: "_Screen",
    forms: Sequence[Form],
) -> tuple[FittedForm, tuple[DiscoveryProblem, Linearised]] | None:
    """Return the form that leaves least with own parameters fitted beside it, and that model.

    None where no form leaves less than the model without one. What is left is measured by the
    noise about the model with which it is least: without a large form, the readings that show
    it pass for noise, and hardly count.
    """
    found = [
        _again(problem, model, _fit(remainder, screen, form, range(len(screen.units))))
        for form in forms
    ]
    quietest = max(
        ((problem, model), *(beside for _, beside in found)),
        key=lambda each: sum(whitening.log_determinant for whitening in each[1].whitenings),
    )
    ruler = Remainder.of(*quietest)
    least, named = ruler.misfit(problem, model), None
    for fitted, beside in found:
        left = ruler.misfit(*beside) + PENALTY * (1 + len(fitted.form.shapes))
        if left < least:
            least, named = left, (fitted, beside)
    return named


def _again(
    problem: DiscoveryProblem, model: Linearised, fitted: FittedForm
) -> tuple[FittedForm, tuple[DiscoveryProblem, Linearised]]:
    """Return a form fitted about everybody's own parameters beside it, and that model.

    Fitted without a large form, own gain and cutoff stand in for a part of it; what is then
    left looks like a form that is too weak, and like something beside it. So own parameters and
    form are fitted in turn until the form stays where it is.
    """

    def beside(form: FittedForm, start: Linearised) -> tuple[DiscoveryProblem, Linearised]:
        within = replace(problem, base=extended(problem.base, [(form.form.id, form.values)]))
        return within, linearise(within, model.chosen, start=start)

    everybody = range(len(problem.subjects))
    within, moved = beside(fitted, model)
    for _ in range(TURNS):
        before = fitted
        # About the new own parameters, but without the form: it is what is fitted.
        remainder = Remainder.of(problem, moved)
        fitted = fit_form(remainder, before.form, before.values, everybody)
        within, moved = beside(fitted, moved)
        if fitted.is_near(before):
            break
    return fitted, (within, moved)


def _small(candidate: Candidate) -> dict[str, float]:
    return {candidate.parameter: candidate.step, **dict(candidate.held)}


@dataclass(frozen=True)
class _Screen:
    """Signatures of all forms at all shapes of their grids, about a model.

    Attributes
    ----------
    forms : tuple of Form
        Of each column.
    candidates : tuple of Candidate
        Of each column.
    units : tuple of Unit
        Whose effects are the columns.
    """

    forms: tuple[Form, ...]
    candidates: tuple[Candidate, ...]
    units: tuple[Unit, ...]

    @classmethod
    def of(cls, problem: DiscoveryProblem, model: Linearised) -> "_Screen":
        """Return the screen about a fitted model."""
        forms = _grammar_of(problem)
        pairs = [(form, each) for form in forms for each in form.candidates()]
        remainder, chosen, units = Remainder.of(problem, model), list(model.chosen), []
        for place, unit in enumerate(model.units):
            bare = remainder.whitened(place, "", {})
            columns = np.column_stack(
                [
                    (bare - remainder.whitened(place, each.effect, _small(each))) / each.step
                    for _, each in pairs
                ]
            )
            accuracy = as_accurate(columns, remainder.accuracy(place))
            known = unit.and_own(unit.effects[:, chosen])
            units.append(replace(known.looking_for(columns, accuracy), readings=bare))
        return cls(
            tuple(form for form, _ in pairs), tuple(each for _, each in pairs), tuple(units)
        )

    def p_value(self, flips: FloatArray) -> float:
        """Return the p of the largest, corrected for all."""
        p = project_out(self.units).significance(flips).p
        return float(np.nanmin(p)) if np.isfinite(p).any() else 1.0

    def _gains(self, units: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Return what each column explains of some units together, and its size there."""
        left = project_out([self.units[unit] for unit in units])
        along, information = left.along.sum(axis=0), left.information.sum(axis=0)
        size = np.divide(along, information, out=np.zeros_like(along), where=information > 0.0)
        return 0.5 * along * size, size

    def promising(self, units: Sequence[int]) -> list[Form]:
        """Return the forms that each of some units shows as the others do, best first."""
        gains = held_out_gain(project_out([self.units[unit] for unit in units])).sum(axis=0)
        best = {
            form: float(gains[[k for k, each in enumerate(self.forms) if each is form]].max())
            for form in dict.fromkeys(self.forms)
        }
        return sorted(best, key=lambda form: -best[form])[:PROMISING]

    def begins(self, form: Form, units: Sequence[int]) -> list[dict[str, float]]:
        """Return dose and shapes at which a form explains most of some units.

        One for each sharpness of its grid: what is narrow and far from where it belongs sees
        none of the tones that would draw it there.
        """
        gains, sizes = self._gains(units)
        best: dict[Held, int] = {}
        for k, each in enumerate(self.forms):
            sharpness = self.candidates[k].held[1:]
            if each is form and gains[k] >= gains[best.get(sharpness, k)]:
                best[sharpness] = k
        return [
            {form.dose: float(sizes[k]), **dict(self.candidates[k].held)} for k in best.values()
        ]


def _grammar_of(problem: DiscoveryProblem) -> tuple[Form, ...]:
    """Return all forms, those of time for the sessions of a problem.

    When between two trials something was changed they do not tell. A step that turns over more
    than half of what lies between them takes trials before and after it for changed by a part,
    and comes out too large; of one over much less no trial tells where it is, nor where to look
    for it from the nearest time at which it was tried.
    """
    minutes = [subject.trials.circumstances.minutes for subject in problem.subjects]
    if not problem.people:  # they share the trials of a session
        minutes = [np.concatenate(minutes)]
    apart = np.concatenate([np.diff(np.unique(each)) for each in minutes])
    if not apart.size:
        return grammar()
    times_min = np.quantile(np.concatenate(minutes), np.linspace(0.0, 1.0, len(TIMES_MIN) + 2))
    step_min = max(0.5 * float(np.median(apart)), NEARER * float(np.median(np.diff(times_min))))
    _, at, over = FORMS["gain_switch_by_time"].parameters
    return grammar(
        np.clip(times_min[1:-1], at.low, at.high).tolist(),
        float(np.clip(step_min, over.low, over.high)),
    )


def _fit(remainder: Remainder, screen: _Screen, form: Form, units: Sequence[int]) -> FittedForm:
    """Return a form fitted to some units, from wherever the screen finds most of it."""
    fits = [fit_form(remainder, form, begin, units) for begin in screen.begins(form, units)]
    return min(fits, key=lambda fitted: fitted.cost)


@dataclass(frozen=True)
class _Compared:
    """Forms by what they surely gain in people who were held out.

    That is the lower end of the interval of the mean: by the sum, a form that one person in
    whom much is left shows would come before one that everybody shows.

    Attributes
    ----------
    gains : dict of Form to ndarray, shape (n_units,)
    honest : ndarray, shape (n_units,)
        Of whatever form the other people chose.
    """

    gains: dict[Form, FloatArray]
    honest: FloatArray

    def alike(self) -> tuple[Form, ...]:
        """Return the forms that are not told from the one that surely gains most, it first.

        Of forms that differ in what their strength follows only, the simpler.
        """
        forms = sorted(self.gains, key=self._sure, reverse=True)
        alike = [
            form
            for form in forms
            if interval_of_mean(self.gains[forms[0]] - self.gains[form])[0] <= 0.0
        ]
        fewest: dict[str, int] = {}
        for form in alike:
            fewest[form.id] = min(len(form.shapes), fewest.get(form.id, len(form.shapes)))
        return tuple(form for form in alike if len(form.shapes) == fewest[form.id])

    def gaining(self) -> tuple[Form, ...]:
        """Return those of `alike` that surely gain: what may be named."""
        return tuple(form for form in self.alike() if self._sure(form) > 0.0)

    def rivals(self, named: Form) -> tuple[Form, ...]:
        """Return the surest form of each other family that is not told from the surest."""
        found: dict[str, Form] = {}
        for form in self.alike():
            if form.family != named.family:
                found.setdefault(form.family, form)
        return tuple(found.values())

    def _sure(self, form: Form) -> float:
        return interval_of_mean(self.gains[form])[0]


def _compare(remainder: Remainder, screen: _Screen) -> _Compared:
    """Return the gains of the promising forms, each unit's from fits without its fold."""
    n_units = len(screen.units)
    folds = [[u for u in range(n_units) if u % FOLDS == fold] for fold in range(FOLDS)]
    trained = [[u for u in range(n_units) if u not in fold] for fold in folds]
    chosen = [screen.promising(units) for units in trained]
    forms = dict.fromkeys(
        form for each in (*chosen, screen.promising(range(n_units))) for form in each
    )
    gains = {form: np.zeros(n_units) for form in forms}
    honest = np.zeros(n_units)
    for fold, units, own in zip(folds, trained, chosen, strict=True):
        inside = {}
        for form in forms:
            fitted = _fit(remainder, screen, form, units)
            gained = np.array([_gain(remainder, fitted, unit) for unit in units])
            gained -= 0.5 * PENALTY * (1 + len(form.shapes)) / len(units)
            inside[form] = interval_of_mean(gained)[0]
            for unit in fold:
                gains[form][unit] = _gain(remainder, fitted, unit)
        picked = max(own, key=lambda form: inside[form])
        honest[fold] = gains[picked][fold]
    return _Compared(gains, honest)


def _gain(remainder: Remainder, fitted: FittedForm, unit: int) -> float:
    """Return by how many nats a form makes a unit more likely."""
    before = remainder.rest(unit, fitted.form.id, {})
    after = remainder.rest(unit, fitted.form.id, fitted.values)
    return 0.5 * float(before @ before - after @ after)
