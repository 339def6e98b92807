"""Finger mobility ``s / (m s^2 + b s + k) exp(-s tau)`` of conditions (paper, Section 2.6)."""

from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.identification.fit import joint_fit
from frictus_service.identification.fit.conditions import Sample
from frictus_service.identification.fit.friction_fit import averages
from frictus_service.identification.fit.joint_fit import JointFit, JointFitProblem

MASS, DAMPING, STIFFNESS = 0, 1, 2
"""Columns of the logarithms: kg, N s/m, N/m."""
LOWEST: Final = np.log([1e-6, 1e-4, 1e-2])
HIGHEST: Final = np.log([1.0, 1e3, 1e6])
_DELAYS_S: Final = np.linspace(-300e-6, 300e-6, 25)


def mass_spring_damper(
    log_parameters: FloatArray, tone_hz: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return the mobility and d ln Y / d (ln m, ln b, ln k), `joint_fit.Law`."""
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
    problem = JointFitProblem(sample, mass_spring_damper, LOWEST, HIGHEST)
    return joint_fit.fit(problem, *_start(sample, n_people))


def _start(sample: Sample, n_people: int) -> tuple[FloatArray, FloatArray]:
    """Return the linear fit of ``1 / Y = m s + b + k / s``, at the best delay of a grid."""
    tone, mean, weight, condition = averages(sample)
    n = sample.people.size
    s = 2j * np.pi * tone
    columns = np.column_stack([s, np.ones_like(s), 1.0 / s])
    certainty = weight * np.square(np.abs(mean)) ** 2  # of 1 / Y
    best = np.full(n_people, np.inf)
    logs, delays = np.zeros((n, 3)), np.zeros(n_people)
    for delay in _DELAYS_S:
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
        found = np.log(np.clip(found / scale, 10.0 * np.exp(LOWEST), 0.1 * np.exp(HIGHEST)))
        logs = np.where(better[sample.people][:, np.newaxis], found, logs)
    return logs, delays
