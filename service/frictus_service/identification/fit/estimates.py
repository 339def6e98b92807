"""The fits of a whole study: friction and mobility of every condition, laws of participants."""

from dataclasses import dataclass, replace

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray, IntArray
from frictus_service.identification.documents import Parameter, Settings
from frictus_service.identification.fit.conditions import (
    ObservationTable,
    Sample,
    Selection,
    select,
)
from frictus_service.identification.fit.joint_fit import JointFit
from frictus_service.identification.fit.speed_law import ConditionEvidence, SpeedLaw, estimate
from frictus_service.identification.fit.transfer_functions import (
    CUTOFF,
    DAMPING,
    GAIN,
    MASS,
    STIFFNESS,
    fit_friction,
    fit_mobility,
)

COLUMNS: dict[Parameter, int] = {
    "gain": GAIN,
    "cutoff": CUTOFF,
    "mass": MASS,
    "damping": DAMPING,
    "stiffness": STIFFNESS,
}
FRICTION: tuple[Parameter, ...] = ("gain", "cutoff")
MOBILITY: tuple[Parameter, ...] = ("mass", "damping", "stiffness")
_LEAST_RATIO = 0.2


@dataclass(frozen=True, slots=True)
class Cells:
    """One parameter in all conditions in which it was estimated; arrays of shape (n,).

    Attributes
    ----------
    person : ndarray of int
        Number of the participant.
    speed_mm_s, force_n : ndarray
        Measured.
    value : ndarray
        Of the parameter.
    """

    person: IntArray
    speed_mm_s: FloatArray
    force_n: FloatArray
    value: FloatArray


@dataclass(frozen=True, slots=True)
class Measured:
    """The conditions as they were measured; arrays of shape (n_conditions,).

    Attributes
    ----------
    person : ndarray of int
        Number of the participant.
    speed_mm_s, force_n : ndarray
        Means of the segments.
    target_mm_s, target_n : ndarray
        What was asked for.
    """

    person: IntArray
    speed_mm_s: FloatArray
    force_n: FloatArray
    target_mm_s: FloatArray
    target_n: FloatArray

    @classmethod
    def of(cls, table: ObservationTable) -> "Measured":
        """Return the means over the rows of each condition of which something is known."""
        people = {name: index for index, name in enumerate(table.participants)}
        return cls(
            np.array([people[condition.participant] for condition in table.conditions]),
            _means(table, table.speed_mm_s),
            _means(table, table.normal_force_n),
            np.array([condition.speed_mm_s for condition in table.conditions]),
            np.array([condition.force_n for condition in table.conditions]),
        )


@dataclass(frozen=True, slots=True)
class Fitted:
    """A response fitted in all conditions that have enough tones.

    Attributes
    ----------
    selection : Selection
        Its groups are the study's conditions.
    fit : JointFit
        Parameters of all conditions and their covariance.
    """

    selection: Selection
    fit: JointFit

    def values(self, parameter: Parameter, n_conditions: int) -> FloatArray:
        """Return a parameter in all of the study's conditions; NaN where no fit settled."""
        out = np.full(n_conditions, np.nan)
        kept = self.fit.settled
        out[self.selection.groups[kept]] = np.exp(
            self.fit.log_parameters[kept, COLUMNS[parameter]]
        )
        return out


def friction_of(
    table: ObservationTable, measured: Measured, settings: Settings
) -> Fitted | None:
    """Fit the friction response of every condition; None if none has enough tones.

    Parameters
    ----------
    table : ObservationTable
        Rows of all usable trials.
    measured : Measured
        Fits of all conditions.
    settings : Settings
        Of the identification.
    """
    chosen = select(table, "friction", table.condition, measured.person, settings.least_tones)
    if not chosen.groups.size:
        return None
    n_people = len(table.participants)
    fitted = Fitted(chosen, fit_friction(chosen.sample, n_people))
    moved = replace(chosen, sample=_at_mean_speed(fitted, measured))
    return Fitted(moved, fit_friction(moved.sample, n_people))


def mobility_of(
    table: ObservationTable, measured: Measured, settings: Settings
) -> Fitted | None:
    """Fit the mobility of every condition; None where nothing measured the skin.

    Parameters
    ----------
    table : ObservationTable
        Rows of all usable trials.
    measured : Measured
        Fits of all conditions.
    settings : Settings
        Of the identification.
    """
    chosen = select(
        table,
        "mobility",
        table.condition,
        measured.person,
        settings.least_tones,
        settings.mobility_highest_hz,
    )
    if not chosen.groups.size:
        return None
    return Fitted(chosen, fit_mobility(chosen.sample, len(table.participants)))


def values_of(
    friction: Fitted | None, mobility: Fitted | None, n_conditions: int
) -> dict[Parameter, FloatArray]:
    """Return every parameter that was fitted, in all conditions of the study."""
    return {
        parameter: fitted.values(parameter, n_conditions)
        for fitted, parameters in ((friction, FRICTION), (mobility, MOBILITY))
        if fitted is not None
        for parameter in parameters
    }


def cells_of(measured: Measured, value: FloatArray) -> Cells:
    """Return a parameter where it is known, with what was measured there."""
    known = np.isfinite(value)
    return Cells(
        measured.person[known],
        measured.speed_mm_s[known],
        measured.force_n[known],
        value[known],
    )


def evidence_of(
    fitted: Fitted, measured: Measured, person: int, kept: BoolArray | None = None
) -> ConditionEvidence | None:
    """Return what is known of a participant's conditions; None if none settled.

    Parameters
    ----------
    fitted : Fitted
        Parameters of all conditions.
    measured : Measured
        Fits of all conditions.
    person : int
        Number of the participant.
    kept : ndarray of bool, or None
        Which of the study's conditions to use.
    """
    fit, sample = fitted.fit, fitted.selection.sample
    used = fit.settled & (sample.people == person)
    if kept is not None:
        used &= kept[fitted.selection.groups]
    if not used.any():
        return None
    if fit.is_clustered[person]:
        trials = used[sample.condition_of_trial]
        pulls = fit.influence[trials]
        condition = (np.cumsum(used) - 1)[sample.condition_of_trial[trials]]
        late = fit.delay_influence[trials]
    else:  # as if each condition had independent pulls of the size of its errors
        roots = np.linalg.cholesky(fit.covariance[used]).transpose(0, 2, 1)
        pulls = np.concatenate([roots.reshape(-1, roots.shape[2]), np.zeros_like(roots[0, :1])])
        condition = np.append(np.repeat(np.arange(len(roots)), roots.shape[1]), 0)
        late = np.append(np.zeros(len(pulls) - 1), np.sqrt(fit.delay_variance[person]))
    return ConditionEvidence(
        measured.speed_mm_s[fitted.selection.groups[used]],
        np.exp(fit.log_parameters[used]),
        _typical(fitted, measured)[used],
        pulls,
        condition,
        float(fit.delay_s[person]),
        late,
        fit.delay_gradient[used],
        np.expm1(fit.rival_shift[used]),
        float(fit.rival_delay_shift_s[person]),
    )


def law_of(
    fitted: Fitted, measured: Measured, person: int, kept: BoolArray | None = None
) -> SpeedLaw | None:
    """Return a participant's speed law; None below two target speeds. As `evidence_of`."""
    used = fitted.fit.settled & (fitted.selection.sample.people == person)
    if kept is not None:
        used &= kept[fitted.selection.groups]
    if np.unique(measured.target_mm_s[fitted.selection.groups[used]]).size < 2:
        return None
    evidence = evidence_of(fitted, measured, person, kept)
    return None if evidence is None else estimate(evidence)


def _means(table: ObservationTable, column: FloatArray) -> FloatArray:
    n, known = len(table.conditions), np.isfinite(column)
    condition = table.condition[known]
    return np.bincount(condition, column[known], n) / np.bincount(condition, minlength=n)


def _typical(fitted: Fitted, measured: Measured) -> FloatArray:
    """Return the variances of the logarithms: the median of the conditions at each speed."""
    variance = np.diagonal(fitted.fit.covariance, axis1=1, axis2=2)
    speed = measured.target_mm_s[fitted.selection.groups]
    typical = np.empty(variance.shape)
    for one in np.unique(speed):
        typical[speed == one] = np.median(variance[speed == one], axis=0)
    return typical


def _at_mean_speed(fitted: Fitted, measured: Measured) -> Sample:
    """Return the rows as they would be at the mean speed of their condition.

    They are moved once, along the laws found so far, and not as the cutoff is fitted: what a
    finger does at other speeds than its mean, or beyond the law, would tell the cutoff, and by
    how little a trial scatters within itself, more than all that its tones say.
    """
    sample = fitted.selection.sample
    mean = measured.speed_mm_s[fitted.selection.groups][sample.condition]
    moved = np.ones_like(sample.response)
    for person in np.unique(sample.people):
        law = law_of(fitted, measured, int(person))
        if law is None:
            continue
        rows = sample.people[sample.condition] == person
        middle, tone_hz = law.cutoff_hz(mean[rows]), sample.tone_hz[rows]
        change = law.slope_hz_per_mm_s * (sample.speed_mm_s[rows] - mean[rows])
        safe = np.where(middle > 0.0, middle, np.inf)
        own = safe * np.maximum(1.0 + change / safe, _LEAST_RATIO)
        moved[rows] = (1.0 + 1j * tone_hz / own) / (1.0 + 1j * tone_hz / safe)
    variance = sample.variance * np.square(np.abs(moved))
    return replace(sample, response=sample.response * moved, variance=variance)
