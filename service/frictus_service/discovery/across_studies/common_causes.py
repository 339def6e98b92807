"""Which causes all studies together ask for: whether by a common size, or by different ones.

Of each candidate two hypotheses are tested: that its mean over laboratories is none, and that
laboratories do not differ in it. Holm's correction counts both of all candidates, so that with
nothing there one collection of studies in twenty names anything at all. A cause too small for
every study alone can be significant here; one that is significant in some study, but not here,
is not taken. No size is selected by its own study.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray
from frictus_service.discovery.across_studies.meta_analysis import (
    LEAST_STUDIES,
    PooledSize,
    pool,
)
from frictus_service.discovery.across_studies.study_statistics import (
    ConditionalSizes,
    StudyStatistics,
    conditional_sizes,
)
from frictus_service.discovery.inference.selection import MOST_CAUSES
from frictus_service.identification.inference.statistics import holm

LEVEL: Final = 0.05
"""Family-wise."""


@dataclass(frozen=True, slots=True)
class PooledCandidate:
    """One candidate over all studies, the chosen causes beside it.

    Attributes
    ----------
    seen : ConditionalSizes
        Its size in each study that shows it.
    pooled : PooledSize or None
        None where fewer than two studies show it.
    p_mean, p_tau : float
        Corrected for both hypotheses of all candidates; 1 where it was not tested.
    """

    seen: ConditionalSizes
    pooled: PooledSize | None
    p_mean: float = 1.0
    p_tau: float = 1.0

    @property
    def p(self) -> float:
        """The smaller of both."""
        return min(self.p_mean, self.p_tau)


def pool_candidates(
    studies: Sequence[StudyStatistics], chosen: Sequence[int]
) -> list[PooledCandidate]:
    """Return every candidate pooled over studies, the same causes beside it in each.

    Parameters
    ----------
    studies : sequence of StudyStatistics
        About the same model.
    chosen : sequence of int
        Candidates in the model.
    """
    positive = studies[0].units[0].positive
    seen = conditional_sizes(studies, chosen)
    pooled = [_pooled(each, positive, k) for k, each in enumerate(seen)]
    tested = [k for k, each in enumerate(pooled) if each is not None]
    raw = np.array([(each.p_mean, each.p_tau) for each in pooled if each is not None])
    corrected = dict(zip(tested, holm(raw.ravel()).reshape(-1, 2).tolist(), strict=True))
    return [
        PooledCandidate(sizes, size, *corrected.get(k, (1.0, 1.0)))
        for k, (sizes, size) in enumerate(zip(seen, pooled, strict=True))
    ]


def _pooled(seen: ConditionalSizes, positive: BoolArray, k: int) -> PooledSize | None:
    if len(seen.studies) < LEAST_STUDIES:
        return None
    return pool(seen.sizes, seen.accuracy, positive=bool(positive[k]))


def choose_causes(studies: Sequence[StudyStatistics], kinds: Sequence[str]) -> tuple[int, ...]:
    """Return the candidates that all studies together ask for, in the order of choice.

    Of the significant the one that best predicts held-out people, then again beside it; what
    others make needless goes, as within a study (`inference.selection`).

    Parameters
    ----------
    studies : sequence of StudyStatistics
        About the same model.
    kinds : sequence of str
        Effect of each candidate; of an effect no more than one is chosen.
    """
    chosen: list[int] = []
    dropped: set[int] = set()
    while len(chosen) < MOST_CAUSES:
        found = pool_candidates(studies, chosen)
        needless = [k for k in chosen if found[k].p > LEVEL or found[k].seen.gain <= 0.0]
        if needless:
            worst = min(needless, key=lambda k: found[k].seen.gain)
            chosen.remove(worst)
            dropped.add(worst)  # or it would come and go for ever
            continue
        taken = {kinds[k] for k in chosen}
        wanted = [
            k
            for k, each in enumerate(found)
            if each.p <= LEVEL
            and each.seen.gain > 0.0
            and kinds[k] not in taken
            and k not in dropped
        ]
        if not wanted:
            break
        chosen.append(max(wanted, key=lambda k: found[k].seen.gain))
    return tuple(chosen)
