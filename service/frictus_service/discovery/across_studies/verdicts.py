"""What is said of a cause over studies: it holds in all, differs, or is in some only."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frictus_hardware.physics.effects import EFFECTS
from frictus_service.discovery.across_studies.common_causes import LEVEL, PooledCandidate
from frictus_service.discovery.across_studies.document import (
    Alike,
    BaseParameterAcross,
    CauseAcross,
    PooledEstimate,
    SizeInStudy,
    SizesVerdict,
    StudyOutcome,
)
from frictus_service.discovery.across_studies.meta_analysis import (
    LEAST_STUDIES,
    PooledSize,
    StudySizes,
    pool,
)
from frictus_service.discovery.across_studies.phrasing import base_sentence, cause_sentence
from frictus_service.discovery.across_studies.study_statistics import (
    StudyStatistics,
    sizes_of_people,
)
from frictus_service.discovery.catalogue.causes import separating_experiment
from frictus_service.discovery.decision.naming import ALIKE
from frictus_service.discovery.inference.linear_model import similarity
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.identification.inference.statistics import holm


def verdict_of(found: PooledCandidate) -> SizesVerdict:
    """Return what a candidate's sizes in all studies say, likeness aside.

    Parameters
    ----------
    found : PooledCandidate
        With the chosen causes beside it.
    """
    if found.pooled is None:
        return "not_tested"
    if found.p_tau > LEVEL:
        return "holds_in_all" if found.p_mean <= LEVEL else "not_shown"
    sizes = found.seen.sizes
    has = np.abs(sizes.value) > sizes.simultaneous_half_width + found.seen.accuracy
    if np.unique(np.sign(sizes.value[has])).size > 1:
        return "opposite_signs"
    if has.any():
        typical = float(np.average(sizes.value[has], weights=1.0 / sizes.variance[has]))
        without = np.abs(sizes.value) <= sizes.half_width
        without &= np.abs(sizes.value - typical) > sizes.half_width
        if without.any():
            return "in_some_only"
    return "size_differs"


@dataclass(frozen=True, slots=True)
class StudiesAbout:
    """All studies about the same causes.

    Attributes
    ----------
    summaries : sequence of StudyOutcome
        Of each study.
    statistics : sequence of StudyStatistics
        Likewise.
    candidates : sequence of Candidate
        Of all studies.
    chosen : tuple of int
        Candidates in the model.
    """

    summaries: Sequence[StudyOutcome]
    statistics: Sequence[StudyStatistics]
    candidates: Sequence[Candidate]
    chosen: tuple[int, ...]

    def causes(self, found: Sequence[PooledCandidate]) -> list[CauseAcross]:
        """Return each cause by its clearest candidate, the clearest first.

        Parameters
        ----------
        found : sequence of PooledCandidate
            Of each candidate, beside the chosen ones.
        """
        clearest: dict[str, int] = {}
        for k in sorted(range(len(found)), key=lambda k: (k not in self.chosen, found[k].p)):
            clearest.setdefault(self.candidates[k].effect, k)
        return [self._cause(k, found[k]) for k in clearest.values()]

    def _cause(self, k: int, found: PooledCandidate) -> CauseAcross:
        candidate = self.candidates[k]
        effect = EFFECTS[candidate.effect]
        units = {parameter.name: parameter.unit for parameter in effect.parameters}
        alike = self._alike(k) if k in self.chosen else ()
        sizes = verdict_of(found)
        pooled = None
        if found.pooled is not None:
            pooled = _estimate(found.pooled, found.p_mean, found.p_tau, candidate.positive)
        studies = self._studies(found.seen.sizes, found.seen.studies, effect.id)
        unit = units[candidate.parameter]
        return CauseAcross(
            id=effect.id,
            verdict="cannot_tell" if alike else sizes,
            sizes=sizes,
            sentence=cause_sentence(
                sizes, effect.scope, pooled, studies, unit, alike, self._few_people(studies)
            ),
            scope=effect.scope,
            in_model=k in self.chosen,
            parameter=candidate.parameter,
            unit=unit,
            held=dict(candidate.held),
            pooled=pooled,
            studies=studies,
            alike=alike,
            depends_on=self._depends_on(found, candidate.positive),
        )

    def _alike(self, k: int) -> tuple[Alike, ...]:
        """Return other causes that look like one in all studies together."""
        others = [other for other in self.chosen if other != k]
        views = [
            [unit for study in self.statistics for unit in getattr(study, view)]
            for view in ("units", "designed")
        ]
        cosines = np.array([similarity(units, others)[k] for units in views])
        largest = cosines[np.argmax(np.abs(cosines), axis=0), np.arange(cosines.shape[1])]
        own = self.candidates[k].effect
        found: dict[str, float] = {}
        for other in np.argsort(-np.abs(largest)).tolist():
            name = self.candidates[other].effect
            if abs(largest[other]) > ALIKE and name != own and other not in self.chosen:
                found.setdefault(name, float(largest[other]))
        return tuple(
            Alike(
                id=name,
                similarity=cosine,
                separating_experiment=separating_experiment(own, name),
            )
            for name, cosine in found.items()
        )

    def _studies(
        self, sizes: StudySizes, shown: Sequence[int], effect: str
    ) -> tuple[SizeInStudy, ...]:
        return tuple(
            SizeInStudy(
                study=self.summaries[study].name,
                value=float(value),
                standard_error=float(np.sqrt(variance)),
                ci95=(float(value - half), float(value + half)),
                people=int(degrees) + 1,
                named=effect in self.summaries[study].causes,
            )
            for study, value, variance, degrees, half in zip(
                shown,
                sizes.value,
                sizes.variance,
                sizes.degrees,
                sizes.half_width,
                strict=True,
            )
        )

    def _depends_on(self, found: PooledCandidate, positive: bool) -> tuple[str, ...]:
        """Return the studies without any one of which the mean, or the difference, is lost."""
        if found.pooled is None or found.p > LEVEL or len(found.seen.studies) <= LEAST_STUDIES:
            return ()
        of_mean = found.p_mean <= found.p_tau
        lost = []
        for place, study in enumerate(found.seen.studies):
            rest = pool(found.seen.sizes.without(place), found.seen.accuracy, positive=positive)
            if (rest.p_mean if of_mean else rest.p_tau) > LEVEL:
                lost.append(self.summaries[study].name)
        return tuple(lost)

    def _few_people(self, studies: Sequence[SizeInStudy]) -> bool:
        blocks = {each.name for each in self.summaries if each.held_out == "blocks"}
        return any(each.study in blocks for each in studies)

    def base_parameters(self, names: Sequence[str]) -> list[BaseParameterAcross]:
        """Return how the base model's own parameters differ between studies.

        Parameters
        ----------
        names : sequence of str
            Of the columns of `StudyStatistics.own`.
        """
        sizes = [
            sizes_of_people([study.own[:, column] for study in self.statistics])
            for column in range(len(names))
        ]
        pooled = [pool(each) for each in sizes]
        p_tau = holm(np.array([each.p_tau for each in pooled])).tolist()
        return [self._base(*each) for each in zip(names, sizes, pooled, p_tau, strict=True)]

    def _base(
        self, name: str, sizes: StudySizes, found: PooledSize, p_tau: float
    ) -> BaseParameterAcross:
        pooled = _estimate(found, found.p_mean, p_tau, positive=False)
        studies = self._studies(sizes, range(len(self.statistics)), "")
        differs = p_tau <= LEVEL
        return BaseParameterAcross(
            id=name,
            differs=differs,
            sentence=base_sentence(pooled, differs, self._few_people(studies)),
            pooled=pooled,
            studies=studies,
        )


def _estimate(found: PooledSize, p_mean: float, p_tau: float, positive: bool) -> PooledEstimate:
    least = 0.0 if positive else -np.inf
    low, high = found.ci95
    predicted = found.prediction95
    return PooledEstimate(
        value=max(found.value, least),
        standard_error=found.standard_error,
        ci95=(max(low, least), max(high, least)),
        tau=found.tau,
        tau_ci95=found.tau_ci95,
        i2=found.i2,
        q=found.q,
        prediction95=predicted and (max(predicted[0], least), max(predicted[1], least)),
        p_mean=p_mean,
        p_tau=p_tau,
    )
