"""From fits to what stands in the document: conditions, sweeps, participants."""

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.identification.documents import (
    ConditionFit,
    CovarianceResult,
    EstimatedQuantity,
    Friction,
    FrictionResult,
    LawResult,
    MobilityEstimate,
    MobilityResult,
    Parameter,
    ParticipantResult,
    Settings,
    SweepResult,
)
from frictus_service.identification.fit.conditions import ObservationTable, select
from frictus_service.identification.fit.estimates import Fitted, Measured, evidence_of, law_of
from frictus_service.identification.fit.grouped_errors import freedom_of_sum
from frictus_service.identification.fit.joint_fit import ALIKE, JointFit
from frictus_service.identification.fit.speed_law import NAMES, Combination, SpeedLaw, levels
from frictus_service.identification.fit.transfer_functions import CUTOFF, GAIN, refit_friction

MOBILITY_NAMES = ("mass_kg", "damping_n_s_m", "stiffness_n_m", "skew_s")


def estimates_of(fit: JointFit, people: NDArray[np.int64]) -> list[list[EstimatedQuantity]]:
    """Return the parameters of each condition, intervals on the logarithm, by t.

    The variance is that of the scatter and that of the delay, of which fewer trials tell: its
    degrees of freedom by Satterthwaite.

    Parameters
    ----------
    fit : JointFit
        Parameters of all conditions and their covariance.
    people : ndarray of int, shape (n_conditions,)
    """
    by_delay = np.square(fit.delay_gradient) * fit.delay_variance[people][:, np.newaxis]
    alone = np.einsum("cii->ci", fit.covariance) + np.square(fit.rival_shift)
    of_scatter, of_delay = (
        each[people][:, np.newaxis] for each in (fit.freedom, fit.delay_freedom)
    )
    freedom = freedom_of_sum(alone, of_scatter, by_delay, of_delay)
    error = np.sqrt(alone + by_delay)
    value = np.exp(fit.log_parameters)
    spread = np.exp(np.minimum(stats.t.ppf(0.975, freedom) * error, 50.0))
    return [
        [
            EstimatedQuantity(value=v, standard_error=v * e, ci95=(v / s, v * s))
            for v, e, s in zip(*row, strict=True)
        ]
        for row in zip(value.tolist(), error.tolist(), spread.tolist(), strict=True)
    ]


def conditions_of(
    table: ObservationTable,
    measured: Measured,
    fits: dict[str, Fitted | None],
    outliers: dict[Parameter, BoolArray],
    settings: Settings,
) -> tuple[ConditionFit, ...]:
    """Return every condition, fitted or not.

    Parameters
    ----------
    table : ObservationTable
        Rows of all usable trials.
    measured : Measured
        Fits of all conditions.
    fits : dict
        By 'friction' and 'mobility'.
    outliers : dict
        By parameter; shape (n_conditions,).
    settings : Settings
        Of the identification.
    """
    trials = [
        np.unique(table.trial[table.condition == c]).size for c in range(measured.person.size)
    ]
    tones = [
        np.unique(table.tone_hz[table.condition == c]).size for c in range(measured.person.size)
    ]
    found = {name: _by_condition(fitted) for name, fitted in fits.items()}
    out = []
    for c, condition in enumerate(table.conditions):
        friction, mobility = found["friction"].get(c), found["mobility"].get(c)
        out.append(
            ConditionFit(
                participant=condition.participant,
                speed_mm_s=condition.speed_mm_s,
                force_n=condition.force_n,
                measured_speed_mm_s=float(measured.speed_mm_s[c]),
                measured_force_n=float(measured.force_n[c]),
                trials=trials[c],
                tones=tones[c],
                friction=friction
                and Friction(gain_n=friction[GAIN], cutoff_hz=friction[CUTOFF]),
                mobility=mobility
                and MobilityEstimate(
                    **dict(zip(MOBILITY_NAMES[:3], mobility, strict=True)),
                ),
                missing=_missing(c, fits, settings),
                outlier=tuple(p for p, far in outliers.items() if far[c]),
            )
        )
    return tuple(out)


def _by_condition(fitted: Fitted | None) -> dict[int, list[EstimatedQuantity]]:
    if fitted is None:
        return {}
    rows = estimates_of(fitted.fit, fitted.selection.sample.people)
    return {
        int(group): row
        for group, row, settled in zip(
            fitted.selection.groups, rows, fitted.fit.settled, strict=True
        )
        if settled
    }


def _missing(c: int, fits: dict[str, Fitted | None], settings: Settings) -> tuple[str, ...]:
    """Return why a condition has no friction or no mobility."""
    out = []
    for name, fitted in fits.items():
        if fitted is None:
            continue  # said once, of the whole study
        place = np.flatnonzero(fitted.selection.groups == c)
        if not place.size:
            count = int(fitted.selection.tones[c])
            out.append(f"{name}: {count} tones; accepted: {settings.least_tones} at least")
        elif not fitted.fit.settled[place[0]]:
            out.append(f"{name}: the fit does not settle within its bounds; measure again")
    return tuple(out)


def sweeps_of(
    table: ObservationTable, measured: Measured, friction: Fitted, settings: Settings
) -> tuple[SweepResult, ...]:
    """Return gain and cutoff of sweep j of all trials of a condition, by direction.

    Parameters
    ----------
    table : ObservationTable
        Rows of all usable trials.
    measured : Measured
        Fits of all conditions.
    friction : Fitted
        Its delays and its scatter are taken as known.
    settings : Settings
        Of the identification.
    """
    place = np.full(measured.person.size, -1)
    place[friction.selection.groups] = np.arange(friction.selection.groups.size)
    columns = np.column_stack([table.condition, table.sweep, table.direction])
    keys, group = np.unique(columns, axis=0, return_inverse=True)
    group = np.where(place[table.condition] >= 0, group.ravel(), -1)
    people = measured.person[keys[:, 0]]
    chosen = select(table, "friction", group, people, settings.least_tones)
    if not chosen.groups.size:
        return ()
    keys = keys[chosen.groups]
    begin = friction.fit.log_parameters[place[keys[:, 0]]]
    fit = refit_friction(chosen.sample, begin, friction.fit.delay_s, friction.fit.spreads)
    rows = estimates_of(fit, chosen.sample.people)
    return tuple(
        SweepResult(
            participant=table.conditions[condition].participant,
            speed_mm_s=table.conditions[condition].speed_mm_s,
            force_n=table.conditions[condition].force_n,
            sweep=sweep,
            direction=1 if direction > 0 else -1,
            tones=int(chosen.tones[number]),
            gain_n=row[GAIN],
            cutoff_hz=row[CUTOFF],
        )
        for (condition, sweep, direction), number, row, settled in zip(
            keys.tolist(), chosen.groups, rows, fit.settled, strict=True
        )
        if settled
    )


def participants_of(
    table: ObservationTable,
    measured: Measured,
    fits: dict[str, Fitted | None],
    outliers: dict[Parameter, BoolArray],
) -> tuple[ParticipantResult, ...]:
    """Return every participant.

    Parameters
    ----------
    table : ObservationTable
        Rows of all usable trials.
    measured : Measured
        Fits of all conditions.
    fits : dict
        By 'friction' and 'mobility'.
    outliers : dict
        By parameter; shape (n_conditions,).
    """
    friction, mobility = fits["friction"], fits["mobility"]
    out = []
    for person, name in enumerate(table.participants):
        own = measured.person == person
        used = own & _is_fitted(friction or mobility, own.size)
        rows = (used if used.any() else own)[table.condition]
        drives = [table.trials[trial].info.drive_vpp for trial in np.unique(table.trial[rows])]
        out.append(
            ParticipantResult(
                participant=name,
                speed_range_mm_s=_range(table.speed_mm_s[rows]),
                force_range_n=_range(table.normal_force_n[rows]),
                drive_range_vpp=(min(drives), max(drives)),
                conditions=int(np.count_nonzero(own)),
                friction=friction and _friction(friction, measured, person, outliers),
                mobility=mobility and _mobility(mobility, measured, person),
            )
        )
    return tuple(out)


def _is_fitted(fitted: Fitted | None, n_conditions: int) -> BoolArray:
    """Return which conditions a fit speaks of: ranges of others are none of its model."""
    found = np.zeros(n_conditions, dtype=np.bool_)
    if fitted is not None:
        found[fitted.selection.groups[fitted.fit.settled]] = True
    return found


def _range(values: FloatArray) -> tuple[float, float]:
    """Return the range without the outermost twentieths, which are single stretches."""
    low, high = np.nanquantile(values, (0.05, 0.95))
    return float(low), float(high)


def _friction(
    fitted: Fitted, measured: Measured, person: int, outliers: dict[Parameter, BoolArray]
) -> FrictionResult | None:
    evidence = evidence_of(fitted, measured, person)
    if evidence is None:
        return None
    law = law_of(fitted, measured, person)
    mean = law.estimates if law is not None else levels(evidence)
    each = _each(mean)
    at = []
    for speed in np.unique(measured.target_mm_s[measured.person == person]).tolist():
        there = evidence_of(fitted, measured, person, measured.target_mm_s == speed)
        if there is not None:
            at.append((float(there.speed_mm_s.mean()), _each(levels(there))[CUTOFF]))
    far = (outliers["gain"] | outliers["cutoff"]) & (measured.person == person)
    rest = law_of(fitted, measured, person, ~far) if far.any() else None
    return FrictionResult(
        gain_n=each[0],
        delay_s=each[-1],
        cutoff_at=tuple(at),
        law=law and law_result(law),
        without_law=None if law else f"one speed only ({at[0][0]:.0f} mm/s): no speed law",
        law_without_outliers=rest and law_result(rest),
        degrees_of_freedom=evidence.degrees_of_freedom,
        excess_hz=law.excess_hz if law else None,
        second_solution=_second_solution(fitted, measured, person),
    )


def _second_solution(fitted: Fitted, measured: Measured, person: int) -> str | None:
    """Return what a second solution is that explains a participant's trials alike."""
    fit, of = fitted.fit, fitted.selection
    own = np.flatnonzero((of.sample.people == person) & fit.settled)
    shift = fit.rival_shift[own, CUTOFF]
    if not np.any(shift):
        return None
    most = own[np.argmax(np.abs(shift))]
    at = fit.log_parameters[most, CUTOFF]
    first, second = np.exp([at, at + fit.rival_shift[most, CUTOFF]])
    delay_us = 1e6 * fit.delay_s[person]
    later_us = delay_us + 1e6 * fit.rival_delay_shift_s[person]
    return (
        f"two solutions explain the trials alike (log-likelihoods {fit.rival_deficit:.1f} "
        f"apart; accepted: {ALIKE:.1f} at least): a delay of {delay_us:.0f} or "
        f"{later_us:.0f} µs, a cutoff of {first:.0f} or {second:.0f} Hz at "
        f"{measured.speed_mm_s[of.groups[most]]:.0f} mm/s; the intervals hold both"
    )


def law_result(law: SpeedLaw) -> LawResult:
    """Return a speed law as it stands in the document."""
    gain, cutoff_0, slope, delay = _each(law.estimates)
    return LawResult(
        gain_n=gain,
        cutoff_0_hz=cutoff_0,
        slope_hz_per_mm_s=slope,
        delay_s=delay,
        covariance=_covariance(law.estimates, NAMES),
    )


def _mobility(fitted: Fitted, measured: Measured, person: int) -> MobilityResult | None:
    evidence = evidence_of(fitted, measured, person)
    if evidence is None:
        return None
    mean = levels(evidence)
    mass, damping, stiffness, delay = _each(mean)
    return MobilityResult(
        mass_kg=mass,
        damping_n_s_m=damping,
        stiffness_n_m=stiffness,
        delay_s=delay,
        covariance=_covariance(mean, MOBILITY_NAMES),
    )


def _each(found: Combination) -> list[EstimatedQuantity]:
    error = np.sqrt(np.diag(found.covariance))
    return [
        EstimatedQuantity(value=value, standard_error=sd, ci95=(value - half, value + half))
        for value, sd, half in zip(
            found.value.tolist(), error.tolist(), found.half_width.tolist(), strict=True
        )
    ]


def _covariance(found: Combination, names: tuple[str, ...]) -> CovarianceResult:
    return CovarianceResult(
        parameters=names, matrix=tuple(tuple(row) for row in found.covariance.tolist())
    )
