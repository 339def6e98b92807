"""What of a study is needed to compare it with others: its people's signatures, condensed.

Whitened readings and signatures of a person have thousands of rows, and everything inferred
from them depends on inner products only. A QR decomposition keeps those in a square of as many
rows as there are columns, so that a study of any length becomes a few hundred kilobytes, and
causes can be chosen for all studies together without going back to any of them.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.across_studies.meta_analysis import StudySizes
from frictus_service.discovery.evidence.observation_table import LEAST_UNITS
from frictus_service.discovery.inference.linear_model import (
    ProjectedUnits,
    Unit,
    held_out_gain,
    project_out,
)

_LEAST_SHARE = 1e-12
"""Of a size's square: people who agree better than that agree to rounding."""


@dataclass(frozen=True, slots=True)
class StudyStatistics:
    """One study about a model.

    Attributes
    ----------
    units : tuple of Unit
        People, or blocks of their trials; condensed, without patterns.
    designed : tuple of Unit
        The same as the design alone makes them: what looks alike is judged by both.
    own : ndarray, shape (n_units, n_base)
        Logarithms of each unit's parameters of the base model, less the base model's.
    """

    units: tuple[Unit, ...]
    designed: tuple[Unit, ...]
    own: FloatArray

    def left(self, effect: int, chosen: Sequence[int]) -> ProjectedUnits:
        """Return the units with all chosen effects but one projected out."""
        return project_out(self.units, [other for other in chosen if other != effect])


def condense(unit: Unit) -> Unit:
    """Return a unit with the same inner products in as few rows as it has columns.

    Parameters
    ----------
    unit : Unit
        Whitened readings and signatures of a participant or block.

    Returns
    -------
    Unit
        Without patterns.
    """
    columns = np.column_stack([unit.own, unit.effects, unit.readings])
    square: FloatArray = np.linalg.qr(columns).R
    n_own = unit.own.shape[1]
    return replace(
        unit,
        own=square[:, :n_own],
        effects=square[:, n_own:-1],
        readings=square[:, -1],
        generic=np.zeros((square.shape[0], 0)),
        generic_accuracy=np.zeros(0),
    )


@dataclass(frozen=True, slots=True)
class ConditionalSizes:
    """Size of one candidate in all studies, the chosen causes beside it.

    Attributes
    ----------
    studies : tuple of int
        Numbers of the studies that show it.
    sizes : StudySizes
        In these.
    accuracy : float
        To which a mean is measured.
    gain : float
        Nats by which held-out people are predicted better, all studies together: from the
        others of their study, or from all others, whichever predicts better.
    """

    studies: tuple[int, ...]
    sizes: StudySizes
    accuracy: float
    gain: float


def conditional_sizes(
    studies: Sequence[StudyStatistics], chosen: Sequence[int]
) -> list[ConditionalSizes]:
    """Return the size of every candidate in every study, beside the same causes in all of them.

    A cause that is left out of the model is partly taken for another, by how much depends on
    the design. So sizes are comparable between studies only beside the same causes, and they
    are taken of every study, not of those in which they are significant.

    Parameters
    ----------
    studies : sequence of StudyStatistics
        About the same model.
    chosen : sequence of int
        Candidates in the model.
    """
    beside = [project_out(study.units, chosen) for study in studies]
    found = []
    for effect in range(studies[0].units[0].effects.shape[1]):
        left = [study.left(effect, chosen) for study in studies] if effect in chosen else beside
        found.append(_sizes_of(left, effect))
    return found


def _sizes_of(left: Sequence[ProjectedUnits], effect: int) -> ConditionalSizes:
    values = [_known(each.tested[0][:, effect]) for each in left]
    shown = [k for k, value in enumerate(values) if value.size >= LEAST_UNITS]
    there = [left[k] for k in shown]
    return ConditionalSizes(
        studies=tuple(shown),
        sizes=sizes_of_people([values[k] for k in shown]),
        accuracy=float(np.mean([each.margin[effect] for each in there])) if there else 0.0,
        gain=_gain(there, effect) if there else 0.0,
    )


def sizes_of_people(values: Sequence[FloatArray]) -> StudySizes:
    """Return mean, variance of the mean and degrees of freedom of each study.

    Parameters
    ----------
    values : sequence of ndarray, shape (n_units,)
        Of the people of each study; two or more.
    """
    table = [
        (
            each.mean(),
            max(each.var(ddof=1), _LEAST_SHARE * float(np.mean(each**2)), np.finfo(float).tiny)
            / each.size,
            each.size - 1.0,
        )
        for each in values
    ]
    return StudySizes(*np.array(table, dtype=np.float64).reshape(-1, 3).T)


def _known(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]


def _gain(left: Sequence[ProjectedUnits], effect: int) -> float:
    together = replace(
        left[0],
        along=np.concatenate([each.along for each in left]),
        information=np.concatenate([each.information for each in left]),
    )
    within = sum(float(held_out_gain(each)[:, effect].sum()) for each in left)
    return max(within, float(held_out_gain(together)[:, effect].sum()))


_UNIT_ARRAYS = ("readings", "own", "effects", "accuracy", "positive", "squared")


def encode(statistics: StudyStatistics) -> bytes:
    """Return statistics as bytes that hold arrays and nothing that could be run."""
    arrays: dict[str, Any] = {"base": statistics.own}
    for kind in ("units", "designed"):
        for number, unit in enumerate(getattr(statistics, kind)):
            for name in _UNIT_ARRAYS:
                arrays[f"{kind}/{number}/{name}"] = getattr(unit, name)
    stored = io.BytesIO()
    np.savez(stored, **arrays)
    return stored.getvalue()


def decode(stored: bytes) -> StudyStatistics:
    """Return the statistics that `encode` made."""
    with np.load(io.BytesIO(stored), allow_pickle=False) as arrays:
        own = arrays["base"]
        units, designed = (
            tuple(_unit(arrays, f"{kind}/{number}") for number in range(len(own)))
            for kind in ("units", "designed")
        )
    return StudyStatistics(units, designed, own)


def _unit(arrays: Any, place: str) -> Unit:
    found = {name: arrays[f"{place}/{name}"] for name in _UNIT_ARRAYS}
    rows = found["readings"].size
    return Unit(**found, generic=np.zeros((rows, 0)), generic_accuracy=np.zeros(0))
