"""The document of a discovery, assembled from what was decided."""

from collections.abc import ItemsView, Sequence
from importlib.metadata import version
from typing import Final

import numpy as np

from frictus.model import Effect, Model
from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.beyond.beyond import Beyond
from frictus_service.discovery.beyond.phrasing import characterised_forms, discrepancy_of
from frictus_service.discovery.catalogue.causes import cause_of, separating_experiment
from frictus_service.discovery.decision.decision import Decision
from frictus_service.discovery.decision.naming import CauseDecision
from frictus_service.discovery.decision.prediction_gain import (
    UnexplainedPattern,
    gain_of,
    rival_costs,
    unseen,
)
from frictus_service.discovery.document import (
    Alternative,
    CannotTell,
    CauseTest,
    Discovery,
    Evidence,
    NamedCause,
    ParameterEstimate,
    StudyFacts,
    Unexplained,
    Verdict,
)
from frictus_service.discovery.evidence.evidence_rows import EvidenceRows
from frictus_service.discovery.evidence.observation_table import UnitAssignment
from frictus_service.discovery.inference.linear_model import project_out
from frictus_service.discovery.inference.linearisation import Linearised, linearise
from frictus_service.discovery.inference.predictive_density import UnitCoefficients
from frictus_service.discovery.inference.selection import with_refitted_nuisance
from frictus_service.discovery.problem.base_models import law_with_own
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.discovery.report.figures import (
    each_place_once,
    level_bins,
    residual_bins,
    rests_of,
)
from frictus_service.discovery.report.parameters import (
    accepted,
    notes_on_bounds,
    parameter_of,
    parameters_of,
)

POWER: Final = 0.84
"""Quantile of the normal distribution: four of five studies."""


class Assembly:
    """Assembles the document from a decision.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    units : UnitAssignment
        Which trial belongs to which unit.
    rows : EvidenceRows
        Of the whole study.
    first : Decision
        Causes about the base model as it is.
    found : Decision
        Causes beside the form that describes what none of them explains, and what they leave.
    beyond : Beyond
        That form, or a smooth discrepancy.
    flips : ndarray, shape (n_flips, n_units)
    base : Model
        The model that is criticised.
    study : StudyFacts
        Its path, hash, participants and trials.
    seed : int
        Of everything random; the same seed gives the same result.
    notes : tuple of str
        What a reader must know first.
    """

    def __init__(
        self,
        problem: DiscoveryProblem,
        units: UnitAssignment,
        rows: EvidenceRows,
        first: Decision,
        found: Decision,
        beyond: Beyond,
        flips: FloatArray,
        base: Model,
        study: StudyFacts,
        seed: int,
        notes: tuple[str, ...],
    ) -> None:
        self._bare, self._first, self._beyond = problem, first, beyond
        self._problem, self._units, self._rows = beyond.problem, units, rows
        self._found, self._flips, self._base = found, flips, base
        self._study, self._seed, self._notes = study, seed, notes
        self._sure = [each for each in found.named if not each.alike]
        self._unsure = [each for each in found.named if each.alike]
        self._parameters = {
            each.candidate: parameters_of(self._problem, found, each, units.names)
            for each in self._sure
            if each.in_model
        }
        self._chosen = list(self._parameters)

    def document(self) -> Discovery:
        """Return the document."""
        found, problem = self._found, self._problem
        base = (with_refitted_nuisance(self._bare, self._first.base), ())
        model = with_refitted_nuisance(problem, self._model_of(self._chosen))
        extended = (model, tuple(self._chosen))
        before, after = rests_of(self._bare, *base), rests_of(problem, *extended)
        gain = None
        if self._chosen:
            named = UnitCoefficients.of(model.units, self._chosen)
            beside = (with_refitted_nuisance(problem, found.base), ())
            gain = gain_of(problem, named, beside, extended, self._rng)
        return Discovery(
            code_version=version("frictus"),
            seed=self._seed,
            study=self._study,
            response=problem.response,
            base_model=self._base,
            extended_model=self._extended(model),
            verdict=self._verdict(),
            causes=tuple(self._cause(each) for each in self._sure),
            cannot_tell=tuple(pair for each in self._unsure for pair in self._pairs(each)),
            unexplained=each_place_once(map(self._unexplained, found.unexplained)),
            characterised=characterised_forms(self._beyond),
            discrepancy=discrepancy_of(
                self._beyond, self._rows.tones_hz, self._rows.rows.circumstances
            ),
            explained_share=self._explained_share(),
            gain=gain,
            evidence=self._evidence(),
            tests=tuple(self._tests()),
            unseen=tuple(unseen(problem, self._chosen)) if self._chosen else (),
            residuals=tuple(residual_bins(problem, self._rows.tones_hz, before, after)),
            levels=tuple(level_bins(problem, base, extended)),
            notes=(
                *self._notes,
                *(note for each in self._named() for note in notes_on_bounds(*each)),
            ),
        )

    def _named(self) -> list[tuple[Candidate, dict[str, ParameterEstimate]]]:
        """Return the causes in the extended model, with their parameters."""
        candidates = self._problem.candidates
        return [(candidates[k], parameters) for k, parameters in self._parameters.items()]

    def _model_of(self, effects: Sequence[int]) -> Linearised:
        if tuple(effects) == self._found.effects:
            return self._found.extended
        base = self._found.base
        return linearise(self._problem, effects, start=base) if effects else base

    def _verdict(self) -> Verdict:
        found = self._found
        if not found.named and self._beyond.form is not None:
            return "characterised"
        if not found.named:
            return "unexplained" if found.unexplained else "clean"
        # Of two that are not told apart neither is in the extended model.
        open_ = self._unsure or any(each.verdict == "family" for each in found.named)
        open_ = open_ or self._beyond.form is not None
        return "partly_explained" if found.unexplained or open_ else "explained"

    def _explained_share(self) -> float | None:
        found, form = self._found, self._beyond.form
        if form is not None and not self._chosen:
            return form.share
        return found.explained_share if found.named or found.unexplained else None

    def _cause(self, each: CauseDecision) -> NamedCause:
        candidate = self._problem.candidates[each.candidate]
        others = [other for other in self._chosen if other != each.candidate]
        cause = cause_of(candidate.effect)
        return NamedCause(
            id=cause.id,
            statement=cause.statement,
            verdict=each.verdict,
            parameters=self._parameters.get(each.candidate, {}),
            p_value=each.p_value,
            gain=gain_of(
                self._problem,
                self._alone(each.candidate),
                (self._model_of(others), others),
                (self._model_of([*others, each.candidate]), [*others, each.candidate]),
                self._rng,
            )
            if each.in_model
            else None,
            alternatives=tuple(
                Alternative(
                    id=name,
                    similarity=cosine,
                    separating_experiment=separating_experiment(cause.id, name),
                )
                for name, cosine in self._others(each.near)
            ),
            next_experiment=cause.next_experiment,
            evidence=self._evidence(),
            rivals=rival_costs(
                self._found.extended.units, self._problem.candidates, each.candidate, others
            )
            if each.in_model
            else (),
        )

    @property
    def _rng(self) -> np.random.Generator:
        return np.random.default_rng(self._seed)

    def _alone(self, effect: int) -> UnitCoefficients:
        """Return the coefficients of a cause beside all others that were named."""
        model = self._found.extended
        others = [other for other in model.chosen if other != effect]
        beside = [unit.and_own(unit.effects[:, others]) for unit in model.units]
        return UnitCoefficients.of(beside, [effect])

    def _others(self, near: Sequence[tuple[int, float]]) -> ItemsView[str, float]:
        """Return other causes with their cosines, each once."""
        names: dict[str, float] = {}
        for candidate, cosine in near:
            names.setdefault(self._problem.candidates[candidate].effect, cosine)
        return names.items()

    def _pairs(self, each: CauseDecision) -> list[CannotTell]:
        name = self._problem.candidates[each.candidate].effect
        return [
            CannotTell(
                between=(name, other),
                separating_experiment=separating_experiment(name, other),
                similarity=cosine,
                p_value=each.p_value,
            )
            for other, cosine in self._others(each.alike)
        ]

    def _unexplained(self, each: UnexplainedPattern) -> Unexplained:
        tones = self._rows.tones_hz[list(each.tones)]
        band = (
            (float(tones.min()), float(tones.max()))
            if tones.size
            else _BANDS[each.pattern.channel]
        )
        covariate = each.pattern.covariate
        return Unexplained(
            channel=each.pattern.channel,
            band_hz=band,
            covariate=None if covariate == "none" else covariate,
            p_value=each.p_value,
        )

    def _extended(self, model: Linearised) -> Model:
        """Return the base model with the population's own values and the named effects."""
        if not self._chosen and self._beyond.effect is None:
            return self._base
        law = law_with_own(self._base.base, self._problem.response, model.own.mean(axis=0))
        effects = [
            Effect(id=candidate.effect, parameters=accepted(candidate, parameters))
            for candidate, parameters in self._named()
        ]
        if self._beyond.effect is not None:
            id_, values = self._beyond.effect
            effects.append(Effect(id=id_, parameters=dict(values)))
        return self._base.model_copy(
            update={
                "base": law,
                "effects": [*self._base.effects, *effects],
                "covariance": None,
                "provenance": {
                    **self._base.provenance,
                    "source": "discovery",
                    "study_sha256": self._study.sha256,
                    "simulated": self._study.simulated,
                    "code_version": version("frictus"),
                    "settings": {"response": self._problem.response},
                    "seed": self._seed,
                    "participants": self._study.participants,
                },
            }
        )

    def _evidence(self) -> Evidence:
        people = len(set(self._units.participant))
        count = len(self._units.names)
        if self._units.held_out == "participants":
            statement = (
                f"{people} participants, each of whom counts once; each was predicted from the "
                "others."
            )
        else:
            statement = (
                f"{people} participant{'s' if people > 1 else ''}, in {count} blocks of "
                "trials, each predicted from the others: it holds for these people, and says "
                "nothing of others."
            )
        return Evidence(
            participants=people,
            trials=self._study.trials_used,
            rows=int(self._rows.tone.size),
            held_out=self._units.held_out,
            statement=statement,
        )

    def _tests(self) -> list[CauseTest]:
        """Return what came of every cause about the base model."""
        problem, first = self._problem, self._found.first
        left = project_out(self._found.base.units)
        critical = left.critical(self._flips, 0.05)
        tests = {}
        for name in {candidate.effect for candidate in problem.candidates}:
            own = [k for k, each in enumerate(problem.candidates) if each.effect == name]
            seen = [k for k in own if np.isfinite(first.t[k])]
            if not seen:
                reason = (
                    f"this design does not show it; it needs: {cause_of(name).visible_with}"
                )
                tests[name] = CauseTest(id=name, not_tested=reason)
                continue
            best = max(seen, key=lambda k: float(abs(first.t[k])))
            candidate = problem.candidates[best]
            size = float(left.detectable(critical, POWER)[best])
            tests[name] = CauseTest(
                id=name,
                statistic=float(first.t[best]),
                p_value=float(first.p[best]),
                detectable={candidate.parameter: float(parameter_of(candidate, size))},
            )
        return [tests[name] for name in sorted(tests)]


_BANDS: Final = {
    "line50": (50.0, 50.0),
    "line60": (60.0, 60.0),
    "low": (4.0, 30.0),
}
"""Where what no tone says is looked for."""
