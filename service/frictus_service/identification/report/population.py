"""Parameters across participants, each of whom counts once."""

from collections.abc import Sequence

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.documents import (
    CovarianceResult,
    LawResult,
    ParticipantResult,
    Population,
    PopulationValue,
)
from frictus_service.identification.fit.speed_law import NAMES
from frictus_service.identification.inference.effects import estimate_of
from frictus_service.identification.inference.statistics import (
    geometric_mean_of,
    lognormal_mean_of,
    mean_of,
)
from frictus_service.identification.report.results import MOBILITY_NAMES

LAW_UNITS = ("N", "Hz", "Hz per mm/s", "s")
MOBILITY_UNITS = ("kg", "N s/m", "N/m", "s")
LOGNORMAL = ("gain_n",)
"""People differ in these by factors."""


def population_of(participants: Sequence[ParticipantResult]) -> Population | None:
    """Return means across participants; None where there is one only.

    Parameters
    ----------
    participants : sequence of ParticipantResult
        One entry each.
    """
    if len(participants) < 2:
        return None
    frictions = [p.friction for p in participants if p.friction is not None]
    laws = [f.law for f in frictions if f.law is not None]
    table = np.array([law_values(law) for law in laws]).reshape(-1, len(NAMES))
    rest = np.array(
        [law_values(f.law_without_outliers or f.law) for f in frictions if f.law is not None]
    ).reshape(-1, len(NAMES))
    differs = any(f.law_without_outliers is not None for f in frictions)
    values = []
    for i, (name, unit) in enumerate(zip(NAMES, LAW_UNITS, strict=True)):
        column = table[:, i]
        if name in ("gain_n", "skew_s") and not laws:
            own = [f.gain_n if name == "gain_n" else f.delay_s for f in frictions]
            column = np.array([estimate.value for estimate in own])
        if column.size > 1:
            without = float(np.mean(rest[:, i])) if differs and laws else None
            values.append(_value(name, unit, column, without))
    skins = [p.mobility for p in participants if p.mobility is not None]
    if len(skins) > 1:
        for name, unit in zip(MOBILITY_NAMES, MOBILITY_UNITS, strict=True):
            field = "delay_s" if name == "skew_s" else name
            column = np.array([getattr(skin, field).value for skin in skins])
            known = "skin_skew_s" if name == "skew_s" else name
            values.append(_value(known, unit, column, None))
    return Population(n=len(participants), values=tuple(values), covariance=_covariance(table))


def law_values(law: LawResult) -> tuple[float, ...]:
    """Return a law's values in the order of `speed_law.NAMES`."""
    return (
        law.gain_n.value,
        law.cutoff_0_hz.value,
        law.slope_hz_per_mm_s.value,
        law.delay_s.value,
    )


def _covariance(table: FloatArray) -> CovarianceResult | None:
    """Return the covariance of the means."""
    n = table.shape[0]
    if n < 2:
        return None
    matrix = np.cov(table.T) / n
    return CovarianceResult(
        parameters=NAMES, matrix=tuple(tuple(row) for row in matrix.tolist())
    )


def _value(name: str, unit: str, column: FloatArray, without: float | None) -> PopulationValue:
    geometric = None if name.endswith("skew_s") else geometric_mean_of(column)
    skewed = lognormal_mean_of(column) if name in LOGNORMAL else None
    return PopulationValue(
        name=name,
        unit=unit,
        n=column.size,
        mean=estimate_of(skewed or mean_of(column)),
        geometric=geometric and estimate_of(geometric),
        between_sd=float(np.std(column, ddof=1)),
        without_outliers=without,
    )
