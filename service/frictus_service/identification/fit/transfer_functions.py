"""Transfer functions fitted: friction and mobility of every condition, and a ready response.

The friction response is ``g w0 / (s + w0) exp(-s tau)`` (paper, Equation 4), the mobility
``s / (m s^2 + b s + k) exp(-s tau)`` (paper, Section 2.6). The delay is what the channels add
beyond hold and declared skew. Without it 100 µs of delay bias the cutoff by -32 to -53 %.

Where only a table of responses is left of a measurement there are no trials, and no people: the
intervals hold for this table, by what it scatters around the fit (Student's t). Errors are
taken as relative; a coherence weighs them (Bendat and Piersol, Random Data, chapter 9: the
relative variance is ``(1 - c) / c`` times what all frequencies share).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray, IntArray
from frictus_service.errors import FieldError
from frictus_service.identification.documents import EstimatedQuantity
from frictus_service.identification.fit import joint_fit
from frictus_service.identification.fit.conditions import Sample
from frictus_service.identification.fit.joint_fit import JointFit
from frictus_service.identification.fit.normal_equations import JointFitProblem, Spreads
from frictus_service.identification.fit.participant_fits import fit_each

GAIN, CUTOFF = 0, 1
"""Columns of the logarithms: gain in N per unit of drive fraction, cutoff in Hz."""
LOWEST: Final = np.log([1e-6, 1.0])
HIGHEST: Final = np.log([50.0, 20_000.0])
_CUTOFFS_HZ: Final = np.geomspace(30.0, 12_000.0, 27)
_DELAYS_S: Final = np.linspace(-1e-3, 5e-3, 241)
_SCATTER: Final = 0.1


def first_order(
    log_parameters: FloatArray, tone_hz: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return H and d ln H / d (ln gain, ln cutoff), `normal_equations.Law`."""
    below = 1.0 / (1.0 + 1j * (tone_hz / np.exp(log_parameters[:, CUTOFF])))
    return (
        np.exp(log_parameters[:, GAIN]) * below,
        np.column_stack([np.ones_like(below), 1.0 - below]),
    )


def fit_friction(sample: Sample, n_people: int) -> JointFit:
    """Fit gain and cutoff of every condition, and one delay per participant.

    Parameters
    ----------
    sample : Sample
        Rows that are fitted together.
    n_people : int
        How many to draw.

    Returns
    -------
    JointFit
        Logarithms: gain (N per unit of drive fraction), cutoff (Hz).
    """
    problem = JointFitProblem(sample, first_order, LOWEST, HIGHEST)
    return fit_each(problem, *_start(sample, n_people))


def refit_friction(
    sample: Sample, begin: FloatArray, delay_s: FloatArray, spreads: Spreads
) -> JointFit:
    """Fit gain and cutoff of parts of conditions, at the delay and with the scatter known.

    Parameters
    ----------
    sample : Sample
        Its conditions are the parts: sweeps, for one.
    begin : ndarray, shape (n_parts, 2)
        Logarithms to begin with.
    delay_s : ndarray, shape (n_people,)
    spreads : Spreads
        Standard deviations that rows of a trial or condition share.
    """
    problem = JointFitProblem(sample, first_order, LOWEST, HIGHEST, fit_delay=False)
    return joint_fit.fit(problem, begin, delay_s, spreads)


def _start(sample: Sample, n_people: int) -> tuple[FloatArray, FloatArray]:
    """Return the best of a grid: a cutoff per condition, a delay per participant."""
    tone, mean, weight, condition = averages(sample)
    n = sample.people.size
    shapes = 1.0 / (1.0 + 1j * np.divide.outer(tone, _CUTOFFS_HZ))
    power = np.square(np.abs(shapes))

    def total(values: FloatArray) -> FloatArray:
        return np.column_stack(
            [np.bincount(condition, weight * column, n) for column in values.T]
        )

    size = total(power)
    best = np.full(n_people, np.inf)
    logs, delays = np.zeros((n, 2)), np.zeros(n_people)
    for delay in _DELAYS_S:
        undone = mean * np.exp(2j * np.pi * tone * delay)
        along = total((undone[:, np.newaxis] * shapes.conj()).real)
        gain = np.maximum(along / size, np.exp(LOWEST[GAIN]))
        cost = gain**2 * size - 2.0 * gain * along
        at = np.argmin(cost, axis=1)
        cost_of_person = np.bincount(sample.people, cost[np.arange(n), at], n_people)
        better = cost_of_person < best
        best = np.where(better, cost_of_person, best)
        delays[better] = delay
        found = np.log(np.column_stack([gain[np.arange(n), at], _CUTOFFS_HZ[at]]))
        logs = np.where(better[sample.people][:, np.newaxis], found, logs)
    return logs, delays


def averages(sample: Sample) -> tuple[FloatArray, ComplexArray, FloatArray, IntArray]:
    """Return tone, mean response, weight and condition for each tone of each condition."""
    tones, tone = np.unique(sample.tone_hz, return_inverse=True)
    key, group = np.unique(sample.condition * tones.size + tone, return_inverse=True)
    certainty = 1.0 / sample.variance
    total = np.bincount(group, certainty)
    mean = np.bincount(group, certainty * sample.response.real).astype(np.complex128)
    mean += 1j * np.bincount(group, certainty * sample.response.imag)
    mean /= total
    weight = 1.0 / (1.0 / total + np.square(_SCATTER * np.abs(mean)))
    return tones[key % tones.size], mean, weight, key // tones.size


MASS, DAMPING, STIFFNESS = 0, 1, 2
"""Columns of the logarithms: kg, N s/m, N/m."""
MOBILITY_LOWEST: Final = np.log([1e-6, 1e-4, 1e-2])
MOBILITY_HIGHEST: Final = np.log([1.0, 1e3, 1e6])
_MOBILITY_DELAYS_S: Final = np.linspace(-300e-6, 300e-6, 25)


def mass_spring_damper(
    log_parameters: FloatArray, tone_hz: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return the mobility and d ln Y / d (ln m, ln b, ln k), `normal_equations.Law`."""
    s = 2j * np.pi * tone_hz
    mass, damping, stiffness = np.exp(log_parameters).T
    terms = np.column_stack([mass * s**2, damping * s, stiffness.astype(np.complex128)])
    total = terms.sum(axis=1)
    return s / total, -terms / total[:, np.newaxis]


def fit_mobility(sample: Sample, n_people: int) -> JointFit:
    """Fit mass, damping and stiffness of every condition, and one delay per participant.

    The delay is that of the skin's channel beyond the force's.

    Parameters
    ----------
    sample : Sample
        Rows that are fitted together.
    n_people : int

    Returns
    -------
    JointFit
        Logarithms: mass (kg), damping (N s/m), stiffness (N/m).
    """
    problem = JointFitProblem(sample, mass_spring_damper, MOBILITY_LOWEST, MOBILITY_HIGHEST)
    return fit_each(problem, *_start_mobility(sample, n_people))


def _start_mobility(sample: Sample, n_people: int) -> tuple[FloatArray, FloatArray]:
    """Return the linear fit of ``1 / Y = m s + b + k / s``, at the best delay of a grid."""
    tone, mean, weight, condition = averages(sample)
    n = sample.people.size
    s = 2j * np.pi * tone
    columns = np.column_stack([s, np.ones_like(s), 1.0 / s])
    certainty = weight * np.square(np.abs(mean)) ** 2  # of 1 / Y
    best = np.full(n_people, np.inf)
    logs, delays = np.zeros((n, 3)), np.zeros(n_people)
    for delay in _MOBILITY_DELAYS_S:
        inverse = np.exp(-s * delay) / mean
        table = np.column_stack([columns, inverse])
        products = (table[:, :, np.newaxis].conj() * table[:, np.newaxis, :]).real
        sums = np.zeros((n, 4, 4))
        np.add.at(sums, condition, certainty[:, np.newaxis, np.newaxis] * products)
        scale = np.sqrt(np.einsum("cii->ci", sums[:, :3, :3]))
        scaled = sums[:, :3, :3] / (scale[:, :, np.newaxis] * scale[:, np.newaxis, :])
        pulled = sums[:, :3, 3] / scale
        found = np.linalg.solve(scaled + 1e-9 * np.eye(3), pulled[:, :, np.newaxis])[:, :, 0]
        cost = sums[:, 3, 3] - np.einsum("ci,ci->c", found, pulled)
        cost_of_person = np.bincount(sample.people, cost, n_people)
        better = cost_of_person < best
        best = np.where(better, cost_of_person, best)
        delays[better] = delay
        found = np.log(
            np.clip(
                found / scale, 10.0 * np.exp(MOBILITY_LOWEST), 0.1 * np.exp(MOBILITY_HIGHEST)
            )
        )
        logs = np.where(better[sample.people][:, np.newaxis], found, logs)
    return logs, delays


LEAST_ROWS: Final = 4
CUTOFFS_HZ: Final = np.geomspace(10.0, 15_000.0, 33)
DELAYS_S: Final = np.linspace(-2e-3, 5e-3, 57)
MICROSECOND: Final = 1e-6
MOST_COHERENT: Final = 0.9999


@dataclass(frozen=True, slots=True)
class ResponseFit:
    """What a table of responses says.

    Attributes
    ----------
    gain : EstimatedQuantity
        In the unit of the table.
    cutoff_hz, delay_s : EstimatedQuantity
        Hz, and s.
    rows : int
        Frequencies that were used.
    residual_db, residual_deg : float
        Root mean square of what the fit leaves, in size and phase.
    """

    gain: EstimatedQuantity
    cutoff_hz: EstimatedQuantity
    delay_s: EstimatedQuantity
    rows: int
    residual_db: float
    residual_deg: float


def fit_response(
    frequency_hz: FloatArray, response: ComplexArray, coherence: FloatArray | None = None
) -> ResponseFit:
    """Fit gain, cutoff and delay to a table of responses.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Above zero.
    response : ndarray of complex, shape (n,)
        Rows with missing values are left out.
    coherence : ndarray, shape (n,), or None
        0 to 1; rows of none are left out. None: all rows weigh the same.

    Raises
    ------
    FieldError
        If fewer than four rows can be used, or the cutoff is beyond what they show.
    """
    from scipy import optimize, stats

    share = np.ones(frequency_hz.size) if coherence is None else coherence
    used = np.isfinite(response) & (response != 0.0) & (frequency_hz > 0.0) & (share > 0.0)
    hz, value = frequency_hz[used], response[used]
    if np.unique(hz).size < LEAST_ROWS:
        raise FieldError(
            "response",
            f"has {np.unique(hz).size} frequencies with a value; accepted: {LEAST_ROWS}",
        )
    kept = np.minimum(share[used], MOST_COHERENT)
    weight = np.ones(hz.size) if coherence is None else np.sqrt(kept / (1.0 - kept))
    weight /= np.sqrt(np.square(weight).mean())

    def residual(parameters: FloatArray) -> FloatArray:
        logs = np.tile(parameters[:2], (hz.size, 1))
        late = np.exp(-2j * np.pi * hz * parameters[2] * MICROSECOND)
        off = weight * (value / (first_order(logs, hz)[0] * late) - 1.0)
        return np.concatenate([off.real, off.imag])

    found = optimize.least_squares(residual, _start_response(hz, value, weight), x_scale="jac")
    if not np.all((LOWEST < found.x[:2]) & (found.x[:2] < HIGHEST)):
        raise FieldError(
            "response",
            f"falls off at {np.exp(found.x[1]):.3g} Hz by the fit; accepted: 1 to 20000 Hz; it "
            "is no first order response, or its frequencies do not reach the cutoff",
        )
    free = 2 * hz.size - 3
    scatter = 2.0 * found.cost / free
    slopes = np.asarray(found.jac, dtype=np.float64)
    errors = np.sqrt(scatter * np.diag(np.linalg.pinv(slopes.T @ slopes)))
    half = float(stats.t.ppf(0.975, free)) * errors
    off = residual(found.x) / np.tile(weight, 2)
    size, phase = off[: hz.size], off[hz.size :]
    return ResponseFit(
        gain=_estimate(found.x[0], errors[0], half[0]),
        cutoff_hz=_estimate(found.x[1], errors[1], half[1]),
        delay_s=EstimatedQuantity(
            value=MICROSECOND * found.x[2],
            standard_error=MICROSECOND * errors[2],
            ci95=(
                MICROSECOND * (found.x[2] - half[2]),
                MICROSECOND * (found.x[2] + half[2]),
            ),
        ),
        rows=hz.size,
        residual_db=float(20.0 / np.log(10.0) * np.sqrt(np.square(size).mean())),
        residual_deg=float(np.rad2deg(np.sqrt(np.square(phase).mean()))),
    )


def _estimate(log_value: float, error: float, half: float) -> EstimatedQuantity:
    value = float(np.exp(log_value))
    ends = (float(np.exp(log_value - half)), float(np.exp(log_value + half)))
    return EstimatedQuantity(value=value, standard_error=value * float(error), ci95=ends)


def _start_response(hz: FloatArray, value: ComplexArray, weight: FloatArray) -> FloatArray:
    """Return the best of a grid of cutoffs and delays; the gain of each follows."""
    shapes = 1.0 / (1.0 + 1j * np.divide.outer(hz, CUTOFFS_HZ))
    certain = np.square(weight / np.abs(value))
    best, start = np.inf, np.zeros(3)
    for delay_s in DELAYS_S.tolist():
        undone = (value * np.exp(2j * np.pi * hz * delay_s))[:, np.newaxis]
        size = certain @ np.square(np.abs(shapes))
        gain = np.maximum(certain @ (undone * shapes.conj()).real / size, 1e-6)
        cost = certain @ np.square(np.abs(undone - gain * shapes))
        at = int(np.argmin(cost))
        if cost[at] < best:
            best = float(cost[at])
            start = np.array([np.log(gain[at]), np.log(CUTOFFS_HZ[at]), delay_s / MICROSECOND])
    return start
