"""A ready frequency response as ``g w0 / (s + w0) exp(-s tau)`` (paper, Equation 4).

Where only a table of responses is left of a measurement there are no trials, and no people:
the intervals hold for this table, by what it scatters around the fit (Student's t). Errors are
taken as relative; a coherence weighs them (Bendat and Piersol, Random Data, chapter 9: the
relative variance is ``(1 - c) / c`` times what all frequencies share).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.errors import FieldError
from frictus_service.identification.documents import Estimate
from frictus_service.identification.fit.friction_fit import HIGHEST, LOWEST, FirstOrder

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
    gain : Estimate
        In the unit of the table.
    cutoff_hz, delay_s : Estimate
        Hz, and s.
    rows : int
        Frequencies that were used.
    residual_db, residual_deg : float
        Root mean square of what the fit leaves, in size and phase.
    """

    gain: Estimate
    cutoff_hz: Estimate
    delay_s: Estimate
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
    law = FirstOrder(np.ones(hz.size))

    def residual(parameters: FloatArray) -> FloatArray:
        logs = np.tile(parameters[:2], (hz.size, 1))
        late = np.exp(-2j * np.pi * hz * parameters[2] * MICROSECOND)
        off = weight * (value / (law(logs, hz)[0] * late) - 1.0)
        return np.concatenate([off.real, off.imag])

    found = optimize.least_squares(residual, _start(hz, value, weight), x_scale="jac")
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
        delay_s=Estimate(
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


def _estimate(log_value: float, error: float, half: float) -> Estimate:
    value = float(np.exp(log_value))
    ends = (float(np.exp(log_value - half)), float(np.exp(log_value + half)))
    return Estimate(value=value, standard_error=value * float(error), ci95=ends)


def _start(hz: FloatArray, value: ComplexArray, weight: FloatArray) -> FloatArray:
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
