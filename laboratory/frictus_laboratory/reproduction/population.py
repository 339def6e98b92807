"""People drawn with the paper's values, and its spread between participants.

How much people differ follows from likelihoods. The paper gives no standard
deviations, but -2 log-likelihoods of models with and without a random intercept of the
participant (Sections 3.1 and 3.2). For J participants with n conditions
each, N = n J, both follow from the two variances alone::

    reduced = N ln(s^2)                                  + N (1 + ln 2 pi)
    full    = N ln(se^2) + J ln(1 + n sb^2 / se^2)       + N (1 + ln 2 pi)

with ``s^2 = se^2 + sb^2``, at the maximum of the likelihood. Two equations, two unknowns.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import optimize
from scipy.special import ndtr, ndtri

from frictus_hardware.arrays import FloatArray
from frictus_laboratory.reproduction import paper
from frictus_laboratory.reproduction.paper import CONDITIONS, PARTICIPANTS, Likelihoods


@dataclass(frozen=True, slots=True)
class MeasurementSpread:
    """Standard deviations, in the unit of what was measured.

    Attributes
    ----------
    residual : float
        Within a participant: of conditions, the estimator's error included.
    between : float
        Of the participants' intercepts.
    """

    residual: float
    between: float


def spread_of(
    found: Likelihoods, participants: int = PARTICIPANTS, conditions: int = CONDITIONS
) -> MeasurementSpread:
    """Return the spread behind two -2 log-likelihoods.

    Parameters
    ----------
    found : Likelihoods
        Without and with the random effect.
    participants, conditions : int
        Number of participants, and of conditions of each.

    Raises
    ------
    ValueError
        If the random intercept gained nothing: the spread between participants is then zero.
    """
    gained = found.reduced - found.full
    if not gained > 0.0:
        raise ValueError(
            f"the random intercept gained {gained:g} in -2 log-likelihood; accepted: above 0"
        )
    count = participants * conditions

    def excess(log_ratio: float) -> float:
        share = math.expm1(log_ratio) / conditions  # sb^2 / se^2
        return count * math.log1p(share) - participants * log_ratio - gained

    log_ratio = optimize.brentq(excess, 1e-9, 50.0)
    total = math.exp(found.reduced / count - 1.0 - math.log(2.0 * math.pi))
    share = math.expm1(log_ratio) / conditions
    within = total / (1.0 + share)
    return MeasurementSpread(math.sqrt(within), math.sqrt(share * within))


MIDDLE_SPEED_MM_S: Final = 60.0
MIDDLE_FORCE_N: Final = 0.4
CUT_SD: Final = 2.0
"""Normal draws are cut here on both sides, which leaves their mean, and scaled back to unit
variance, so that nobody has a negative mass."""

SLOPE_SD: Final = 0.25
"""Of a slope between people, as a share of the slope. The paper fitted no random slopes; people
do not scale all alike (a random intercept alone rejects true nulls)."""
ALONG: Final = 0.8
"""Correlation of a slope with the value at the middle speed: who has more also gains more."""
NULL_SPEED_SD: Final = 0.001
NULL_FORCE_SD: Final = 0.2
"""Of slopes whose mean is zero, as a share of the middle value per mm/s and per N: each person
leans a little, the population does not."""


@dataclass(frozen=True, slots=True)
class Plane:
    """A parameter of one person over speed and force: no interaction, as the null has it.

    Attributes
    ----------
    middle : float
        At 60 mm/s and 0.4 N.
    per_mm_s, per_n : float
        Slopes with speed and force.
    """

    middle: float
    per_mm_s: float = 0.0
    per_n: float = 0.0

    def at(self, speed_mm_s: float, force_n: float = MIDDLE_FORCE_N) -> float:
        """Return the value at a speed and a force."""
        speed, force = speed_mm_s - MIDDLE_SPEED_MM_S, force_n - MIDDLE_FORCE_N
        return self.middle + self.per_mm_s * speed + self.per_n * force


@dataclass(frozen=True, slots=True)
class Person:
    """The truth about one person.

    Attributes
    ----------
    name : str
        Pseudonym.
    planes : mapping of str to Plane
        By the names of `POPULATION`.
    friction_coefficient : float
        Of finger and glass without drive.
    """

    name: str
    planes: Mapping[str, Plane]
    friction_coefficient: float = 0.5


@dataclass(frozen=True, slots=True)
class ParameterDistribution:
    """How a parameter is spread over people.

    Attributes
    ----------
    mean : Plane
        Of the population.
    between : float
        Standard deviation of the middle value.
    lognormal : bool
        The middle value is lognormal, else normal.
    """

    mean: Plane
    between: float
    lognormal: bool = False

    def draw(self, n_people: int, rng: np.random.Generator) -> list[Plane]:
        """Return one plane per person.

        Parameters
        ----------
        n_people : int
            How many to draw.
        rng : Generator
            Source of everything random.
        """
        level, own, force = _cut_normal(rng, (3, n_people))
        speed = ALONG * level + math.sqrt(1.0 - ALONG**2) * own
        mean = self.mean
        per_mm_s = (
            mean.per_mm_s + SLOPE_SD * mean.per_mm_s * speed
            if mean.per_mm_s
            else NULL_SPEED_SD * mean.middle * own
        )
        middle = self._middle(level)
        per_n = NULL_FORCE_SD * mean.middle * force
        return [
            Plane(*map(float, plane)) for plane in zip(middle, per_mm_s, per_n, strict=True)
        ]

    def _middle(self, level: FloatArray) -> FloatArray:
        if not self.lognormal:
            return self.mean.middle + self.between * level
        sigma = math.sqrt(math.log1p((self.between / self.mean.middle) ** 2))
        lifted: FloatArray = np.exp(sigma * level) / _lognormal_mean(sigma)
        return self.mean.middle * lifted


def _from_lowest(at_20: float, slope: float) -> Plane:
    return Plane(at_20 + (MIDDLE_SPEED_MM_S - 20.0) * slope, slope)


_BETWEEN: Final = {name: spread_of(found).between for name, found in paper.LIKELIHOODS.items()}

POPULATION: Final = {
    "gain_n": ParameterDistribution(
        Plane(paper.GAIN_N),
        paper.GAIN_N * _BETWEEN["gain"] / paper.GAIN_N_PER_V,
        lognormal=True,
    ),
    "cutoff_hz": ParameterDistribution(
        Plane(
            paper.CUTOFF_0_HZ + MIDDLE_SPEED_MM_S * paper.CUTOFF_SLOPE_HZ_PER_MM_S,
            paper.CUTOFF_SLOPE_HZ_PER_MM_S,
        ),
        _BETWEEN["cutoff"],
    ),
    "mass_kg": ParameterDistribution(
        _from_lowest(paper.MASS_20_KG, paper.MASS_SLOPE_KG_PER_MM_S), _BETWEEN["mass"]
    ),
    "damping_n_s_m": ParameterDistribution(Plane(paper.DAMPING_N_S_M), _BETWEEN["damping"]),
    "stiffness_n_m": ParameterDistribution(
        _from_lowest(paper.STIFFNESS_20_N_M, paper.STIFFNESS_SLOPE_N_M_PER_MM_S),
        _BETWEEN["stiffness"],
    ),
}
"""The paper's population, by parameter."""


def draw_people(
    n_people: int, rng: np.random.Generator, *, centred: bool = False
) -> list[Person]:
    """Return people of the paper's population.

    Parameters
    ----------
    n_people : int
        How many to draw.
    rng : Generator
        Source of everything random.
    centred : bool
        Shift them (the gain: scale) so that their sample means are the paper's values, as those
        are the estimates from ten people themselves. Else they are free draws, and the paper's
        values are the means of the population.
    """
    while True:
        drawn = {name: spread.draw(n_people, rng) for name, spread in POPULATION.items()}
        if centred:
            drawn = {name: _centred(planes, POPULATION[name]) for name, planes in drawn.items()}
        rubbing = 0.5 * np.exp(0.3 * _cut_normal(rng, (n_people,)))
        people = [
            Person(f"P{number + 1:02}", dict(zip(drawn, planes, strict=True)), float(mu))
            for number, (planes, mu) in enumerate(
                zip(zip(*drawn.values(), strict=True), rubbing, strict=True)
            )
        ]
        if all(_positive(plane) for person in people for plane in person.planes.values()):
            return people


def _positive(plane: Plane) -> bool:
    """Return whether a value is positive wherever it is asked for, and at 0 mm/s."""
    corners = [(speed, force) for speed in (20.0, 100.0) for force in (0.2, 0.6)]
    return all(plane.at(*corner) > 0.0 for corner in [*corners, (0.0, MIDDLE_FORCE_N)])


def _centred(planes: list[Plane], population: ParameterDistribution) -> list[Plane]:
    mean = population.mean
    middle, per_mm_s, per_n = np.mean(
        [(plane.middle, plane.per_mm_s, plane.per_n) for plane in planes], axis=0
    )
    shifted = [
        replace(
            plane,
            per_mm_s=float(plane.per_mm_s - per_mm_s + mean.per_mm_s),
            per_n=float(plane.per_n - per_n + mean.per_n),
        )
        for plane in planes
    ]
    if population.lognormal:
        return [replace(p, middle=float(p.middle * mean.middle / middle)) for p in shifted]
    return [replace(p, middle=float(p.middle - middle + mean.middle)) for p in shifted]


def _cut_normal(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    """Return standard normal draws, cut at `CUT_SD` on both sides, of unit variance."""
    drawn: FloatArray = ndtri(rng.uniform(ndtr(-CUT_SD), ndtr(CUT_SD), shape)) / _CUT_SCALE
    return drawn


def _lognormal_mean(sigma: float) -> float:
    """Return the mean of ``exp(sigma z)``, z of `_cut_normal`."""
    tilt = sigma / _CUT_SCALE
    kept = ndtr(CUT_SD - tilt) - ndtr(-CUT_SD - tilt)
    return float(math.exp(tilt**2 / 2.0) * kept / _KEPT)


_KEPT: Final = float(ndtr(CUT_SD) - ndtr(-CUT_SD))
_CUT_SCALE: Final = math.sqrt(
    1.0 - 2.0 * CUT_SD * math.exp(-(CUT_SD**2) / 2.0) / math.sqrt(2.0 * math.pi) / _KEPT
)
