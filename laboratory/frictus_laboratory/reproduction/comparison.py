"""What came out of the pipeline, set beside the paper and beside the people who were drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import stats

from frictus_laboratory.reproduction import paper
from frictus_laboratory.reproduction.paper import Row
from frictus_laboratory.reproduction.plan import TrialPlan
from frictus_laboratory.reproduction.population import POPULATION, Person
from frictus_service.identification.documents import (
    PARAMETERS,
    EffectTest,
    EstimatedQuantity,
    Identification,
    Parameter,
)

PLANES: Final[dict[Parameter, str]] = dict(zip(PARAMETERS, POPULATION, strict=True))
"""Which of `POPULATION` each parameter of an identification is."""

SLOPES: Final[dict[Parameter, str]] = {
    "cutoff": f"{paper.CUTOFF_SLOPE_HZ_PER_MM_S}",
    "mass": f"{paper.MASS_SLOPE_KG_PER_MM_S} ({paper.MASS_SLOPE_ELSEWHERE_KG_PER_MM_S})",
    "stiffness": f"{paper.STIFFNESS_SLOPE_N_M_PER_MM_S}",
}
NO_EFFECT: Final = "no effect"


@dataclass(frozen=True, slots=True)
class Level:
    """A mean across participants, and what the paper says of it."""

    name: str
    quantity: str
    paper: str


LEVELS: Final = (
    Level("gain_n", "gain", f"{paper.GAIN_N} ({paper.GAIN_N_PER_V} N/V)"),
    Level("cutoff_0_hz", "cutoff, extrapolated to 0 mm/s", f"{paper.CUTOFF_0_HZ}"),
    Level("slope_hz_per_mm_s", "cutoff, speed law", f"{paper.CUTOFF_SLOPE_HZ_PER_MM_S}"),
    Level("mass_kg", "mass at 60 mm/s", "0.00567 (from +0.82 % per mm/s)"),
    Level("damping_n_s_m", "damping", f"{paper.DAMPING_N_S_M} (example)"),
    Level("stiffness_n_m", "stiffness at 60 mm/s", "525 (from +1.11 % per mm/s)"),
    Level("skew_s", "delay", "not fitted"),
)


def compare(
    found: Identification, people: Sequence[Person], plans: Sequence[TrialPlan]
) -> list[Row]:
    """Return the rows of the table.

    Parameters
    ----------
    found : Identification
        Of a study that was simulated from the plans.
    people : sequence of Person
        Those who were drawn.
    plans : sequence of TrialPlan
        One for each trial.
    """
    effects = [_effect_row(effect, _drawn(people, effect)) for effect in found.effects]
    return [
        *level_rows(found, people, plans[0].delay_s),
        *effects,
        *_correlations(found, plans),
    ]


def level_rows(found: Identification, people: Sequence[Person], delay_s: float) -> list[Row]:
    """Return the means across participants.

    Parameters
    ----------
    found : Identification
        The document of an identification.
    people : sequence of Person
        The truth is their mean.
    delay_s : float
        True delay of the drive.
    """
    truth = {
        PLANES[parameter]: _mean([person.planes[PLANES[parameter]].middle for person in people])
        for parameter in PARAMETERS
    }
    truth["cutoff_0_hz"] = _mean([person.planes["cutoff_hz"].at(0.0) for person in people])
    truth["slope_hz_per_mm_s"] = _mean([p.planes["cutoff_hz"].per_mm_s for p in people])
    truth["skew_s"] = delay_s
    values = {} if found.population is None else {v.name: v for v in found.population.values}
    return [
        Row(
            level.quantity,
            values[level.name].unit,
            level.paper,
            truth[level.name],
            *_of(values[level.name].mean),
        )
        for level in LEVELS
        if level.name in values
    ]


def _drawn(people: Sequence[Person], effect: EffectTest) -> float:
    planes = [person.planes[PLANES[effect.parameter]] for person in people]
    each = {
        "speed": [plane.per_mm_s for plane in planes],
        "force": [plane.per_n for plane in planes],
        "interaction": [0.0 for _ in planes],
    }
    return _mean(each[effect.effect])


def _effect_row(effect: EffectTest, drawn: float) -> Row:
    told = SLOPES.get(effect.parameter, NO_EFFECT) if effect.effect == "speed" else NO_EFFECT
    return Row(
        f"{effect.parameter}: {effect.effect}",
        effect.unit,
        told,
        drawn,
        *_of(effect.value),
        p_value=effect.p,
        paper_p=paper.P_VALUES[effect.parameter, effect.effect],
    )


def _correlations(found: Identification, plans: Sequence[TrialPlan]) -> list[Row]:
    """Return the correlation of cutoff and stiffness, as the paper has it and within people."""
    pooled, within = _true_correlations(plans)
    rows = []
    for item in found.correlations:
        if (item.first, item.second) != ("cutoff", "stiffness"):
            continue
        told, told_p = f"{paper.CUTOFF_STIFFNESS_CORRELATION}", paper.CUTOFF_STIFFNESS_P
        # Conditions of one person are not independent: no interval, and p means little.
        r, p = item.pooled.r, item.pooled.p
        rows.append(Row("cutoff and stiffness, pooled", "r", told, pooled, r, None, p, told_p))
        if item.within_mean is not None:
            own = _of(item.within_mean)
            told = "> 0.52 in 7 of 10"
            quantity = "cutoff and stiffness, within people"
            rows.append(Row(quantity, "r", told, within, *own, item.p_within))
    return rows


def _true_correlations(plans: Sequence[TrialPlan]) -> tuple[float, float]:
    """Return Spearman's coefficient over all conditions, and its mean within people."""
    truth = {
        (plan.info.participant, plan.info.speed_mm_s, plan.info.force_n): (
            plan.law.cutoff_0_hz + plan.law.slope_hz_per_mm_s * plan.info.speed_mm_s,
            plan.mobility.stiffness_n_m,
        )
        for plan in plans
    }
    own: dict[str, list[tuple[float, float]]] = {}
    for (name, _, _), pair in truth.items():
        own.setdefault(name, []).append(pair)
    each = [float(stats.spearmanr(pairs).statistic) for pairs in own.values()]
    within = float(np.tanh(np.mean(np.arctanh(np.clip(each, -0.999, 0.999)))))
    return float(stats.spearmanr(list(truth.values())).statistic), within


def _of(estimate: EstimatedQuantity) -> tuple[float, tuple[float, float] | None]:
    return estimate.value, estimate.ci95


def _mean(values: Sequence[float]) -> float:
    mean = float(np.mean(values))
    # Centred people cancel to rounding errors.
    return mean if abs(mean) > 1e-12 * max(map(abs, values)) else 0.0
