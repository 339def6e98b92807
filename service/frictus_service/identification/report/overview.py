"""Figures of the whole study: speed laws, box plots, parameters across participants."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.documents import (
    ConditionFit,
    Correlation,
    CovarianceResult,
    EstimatedQuantity,
    Identification,
    LawResult,
    PairTest,
    Parameter,
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
from frictus_service.identification.report.html import FIT, GRID, ordered, people
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


LABELS: dict[Parameter, str] = {
    "gain": "gain, N",
    "cutoff": "cutoff, Hz",
    "mass": "mass, g",
    "damping": "damping, N s/m",
    "stiffness": "stiffness, N/m",
}
SCALE: dict[Parameter, float] = {"mass": 1e3}
_SIGNIFICANT = 0.05
_MOST_BRACKETS = 4


def value_of(condition: ConditionFit, parameter: Parameter) -> EstimatedQuantity | None:
    """Return a parameter of a condition."""
    friction, mobility = condition.friction, condition.mobility
    if parameter in ("gain", "cutoff"):
        if friction is None:
            return None
        return friction.gain_n if parameter == "gain" else friction.cutoff_hz
    if mobility is None:
        return None
    return {
        "mass": mobility.mass_kg,
        "damping": mobility.damping_n_s_m,
        "stiffness": mobility.stiffness_n_m,
    }[parameter]


def laws(found: Identification) -> Figure:
    """Draw the cutoffs of all conditions over the measured speed, and each speed law."""
    figure = Figure(figsize=(9.5, 4.6), layout="constrained")
    axes = figure.subplots()
    colours = people(len(found.participants))
    for person, colour in zip(found.participants, colours, strict=True):
        own = [
            (condition.measured_speed_mm_s, condition.friction.cutoff_hz)
            for condition in found.conditions
            if condition.participant == person.participant and condition.friction is not None
        ]
        if not own:
            continue
        speed = [at for at, _ in own]
        value = [cutoff.value for _, cutoff in own]
        error = [cutoff.standard_error or 0.0 for _, cutoff in own]
        axes.errorbar(speed, value, error, fmt="o", ms=3.5, lw=0.8, color=colour, alpha=0.6)
        law = person.friction.law if person.friction else None
        if law is not None:
            ends = np.array([min(speed), max(speed)])
            line = law.cutoff_0_hz.value + law.slope_hz_per_mm_s.value * ends
            axes.plot(ends, line, color=colour, lw=1.4, label=person.participant)
    _population_line(axes, found)
    axes.set_xlabel("measured speed, mm/s")
    axes.set_ylabel("cutoff, Hz")
    axes.set_ylim(bottom=0.0)
    axes.grid(**GRID)
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside right upper", fontsize="small", frameon=False)
    return figure


def _population_line(axes: Axes, found: Identification) -> None:
    if found.population is None:
        return
    means = {value.name: value.mean.value for value in found.population.values}
    if "slope_hz_per_mm_s" not in means:
        return
    ends = np.array([min(c.measured_speed_mm_s for c in found.conditions), 0.0])
    ends[1] = max(c.measured_speed_mm_s for c in found.conditions)
    line = means["cutoff_0_hz"] + means["slope_hz_per_mm_s"] * ends
    axes.plot(ends, line, "k--", lw=2.2, label="mean of all")


def boxes(found: Identification, parameter: Parameter) -> Figure | None:
    """Draw a parameter by force and speed as box plots; None where nobody has it.

    Center: median; box: quartiles; whiskers: 1.5 times the box; dots: beyond; plus: mean.
    Brackets: pairs of speeds that differ after Holm's correction.
    """
    known = [
        (c.force_n, c.speed_mm_s, estimate.value * SCALE.get(parameter, 1.0))
        for c in found.conditions
        if (estimate := value_of(c, parameter)) is not None
    ]
    if not known:
        return None
    forces = sorted({force for force, _, _ in known})
    speeds = sorted({speed for _, speed, _ in known})
    figure = Figure(figsize=(9.5, 3.6), layout="constrained")
    axes = figure.subplots()
    width = 0.8 / len(speeds)
    for i, (speed, colour) in enumerate(zip(speeds, ordered(len(speeds)), strict=True)):
        place = np.arange(len(forces)) + (i - (len(speeds) - 1) / 2) * width
        columns = [[x for f, v, x in known if f == force and v == speed] for force in forces]
        there = [j for j, column in enumerate(columns) if column]
        drawn = axes.boxplot(
            [columns[j] for j in there],
            positions=place[there],
            widths=0.8 * width,
            patch_artist=True,
            showmeans=True,
            manage_ticks=False,
            medianprops={"color": "k"},
            meanprops={"marker": "+", "markeredgecolor": "k", "markersize": 5},
            flierprops={"marker": ".", "markersize": 5, "markerfacecolor": "k"},
        )
        for box in drawn["boxes"]:
            box.set(facecolor=colour, alpha=0.75)
        axes.plot([], [], "s", color=colour, label=f"{speed:g} mm/s")
    pairs = [pair for pair in found.pairs if pair.parameter == parameter]
    _brackets(axes, pairs, forces, speeds, width)
    axes.set_xticks(range(len(forces)), [f"{force:g} N" for force in forces])
    axes.set_ylabel(LABELS[parameter])
    axes.grid(axis="y", **GRID)
    figure.legend(loc="outside right upper", fontsize="small", frameon=False)
    return figure


def _brackets(
    axes: Axes,
    pairs: Sequence[PairTest],
    forces: list[float],
    speeds: list[float],
    width: float,
) -> None:
    """Draw the clearest significant pairs of each force above the boxes."""
    low, high = axes.get_ylim()
    step = 0.06 * (high - low)
    most = 0
    for j, force in enumerate(forces):
        clear = sorted(
            (p for p in pairs if p.force_n == force and p.p_holm < _SIGNIFICANT),
            key=lambda pair: pair.p_holm,
        )[:_MOST_BRACKETS]
        for level, pair in enumerate(clear, 1):
            ends = [
                j + (speeds.index(speed) - (len(speeds) - 1) / 2) * width
                for speed in pair.speeds_mm_s
            ]
            at = high + step * level
            axes.plot(ends, [at, at], color="k", lw=0.8, marker="|", ms=4)
            most = max(most, level)
    axes.set_ylim(low, high + step * (most + 1))


def correlation(found: Identification, one: Correlation) -> Figure:
    """Draw two parameters against each other: all points, and each participant's trend."""
    figure = Figure(figsize=(9.5, 4.6), layout="constrained")
    axes = figure.subplots()
    across, along = [], []
    colours = people(len(found.participants))
    for person, colour in zip(found.participants, colours, strict=True):
        own = [
            (x.value, y.value)
            for c in found.conditions
            if c.participant == person.participant
            and (x := value_of(c, one.second)) is not None
            and (y := value_of(c, one.first)) is not None
        ]
        if not own:
            continue
        x, y = np.array(own).T * [[SCALE.get(one.second, 1.0)], [SCALE.get(one.first, 1.0)]]
        across.append(x)
        along.append(y)
        r = one.per_participant.get(person.participant)
        label = person.participant + (f"  {r.r:+.2f}" if r else "")
        axes.plot(x, y, ".", color=colour, ms=6, label=label)
        _trend(axes, x, y, "--", colour, 1.2)
    _trend(axes, np.concatenate(across), np.concatenate(along), "-", "k", 1.8)
    axes.set_xlabel(LABELS[one.second])
    axes.set_ylabel(LABELS[one.first])
    axes.grid(**GRID)
    figure.legend(
        loc="outside right upper", fontsize="small", frameon=False, title="participant, r"
    )
    return figure


def _trend(
    axes: Axes,
    x: FloatArray,
    y: FloatArray,
    look: str,
    colour: str | tuple[float, ...],
    width: float,
) -> None:
    if x.size > 2 and np.ptp(x) > 0.0:
        line = np.polyfit(x - x.mean(), y, 1)
        ends = np.array([x.min(), x.max()])
        axes.plot(ends, np.polyval(line, ends - x.mean()), look, color=colour, lw=width)


def effects(found: Identification) -> Figure | None:
    """Draw every effect per participant, over its spread; None where none was tested."""
    if not found.effects:
        return None
    figure = Figure(figsize=(9.5, 0.34 * len(found.effects) + 1.0), layout="constrained")
    axes = figure.subplots()
    for row, test in enumerate(reversed(found.effects)):
        values = np.array(test.per_participant)
        size = float(np.max(np.abs(values))) or 1.0
        axes.plot(values / size, np.full(values.size, row), ".", color="0.45", ms=6)
        if test.value.ci95 is not None:
            low, high = np.array(test.value.ci95) / size
            axes.plot([low, high], [row, row], color=FIT, lw=2.4, alpha=0.8)
        axes.plot(test.value.value / size, row, "|", color=FIT, ms=12, mew=2)
    names = [f"{test.parameter} by {test.effect}" for test in reversed(found.effects)]
    axes.set_yticks(range(len(names)), names, fontsize="small")
    axes.axvline(0.0, color="k", lw=0.8)
    axes.set_xlabel("effect over the largest of any participant")
    axes.set_xlim(-1.35, 1.35)
    axes.grid(axis="x", **GRID)
    return figure
