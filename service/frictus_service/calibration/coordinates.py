"""What earlier people's calibrations say of a person, in coordinates that are nearly normal.

A person's law in the coordinates in which people are nearly normal.

``(ln cutoff at 20 mm/s, ln cutoff at 100 mm/s, ln gain, delay in s)``: the ends of the range
that the paper measured. Between them the cutoff is a straight line over speed (Equation 9), so
positive ends mean a positive cutoff everywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Self, TypeVar

import numpy as np
from scipy import stats

from frictus.model import Covariance, FirstOrderSpeedLaw, Model, Validity
from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.errors import EstimateError, PriorError

LOW_MM_S: Final = 20.0
HIGH_MM_S: Final = 100.0
SIZE: Final = 4
MODEL_PARAMETERS: Final = ("gain_n", "cutoff_0_hz", "slope_hz_per_mm_s", "skew_s")
"""Order of the covariance of a model, with the delay last."""


Speeds = TypeVar("Speeds", FloatArray, ComplexArray)
"""Real where a finger's speed is meant, complex where a mean over complex weights is."""


def cutoff_hz(coordinates: FloatArray, speed_mm_s: Speeds) -> Speeds:
    """Return the cutoff at each speed, Hz; at least a tenth of the lower of its ends.

    Parameters
    ----------
    coordinates : ndarray, shape (4,)
    speed_mm_s : ndarray, shape (n,)
        Without sign. A little outside 20 to 100 mm/s the line goes on.
    """
    low, high = np.exp(coordinates[:2])
    share = (speed_mm_s - LOW_MM_S) / (HIGH_MM_S - LOW_MM_S)
    line: Speeds = np.maximum(low + (high - low) * share, 0.1 * min(low, high))
    return line


def cutoff_gradient(coordinates: FloatArray, speed_mm_s: FloatArray) -> FloatArray:
    """Return d ln cutoff / d coordinates.

    Parameters
    ----------
    coordinates : ndarray, shape (4,)
    speed_mm_s : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n, 4)
    """
    share = (speed_mm_s - LOW_MM_S) / (HIGH_MM_S - LOW_MM_S)
    cutoff = cutoff_hz(coordinates, speed_mm_s)
    low, high = np.exp(coordinates[:2])
    gradient = np.zeros((speed_mm_s.size, SIZE))
    gradient[:, 0] = (1.0 - share) * low / cutoff
    gradient[:, 1] = share * high / cutoff
    return gradient


def response(
    at: FloatArray, speed_mm_s: Speeds, frequency_hz: FloatArray | ComplexArray
) -> ComplexArray:
    """Return a law's response, N (Equation 4, and the delay).

    Parameters
    ----------
    at : ndarray, shape (4,)
        In these coordinates.
    speed_mm_s, frequency_hz : ndarray
        Without sign; of shapes that broadcast; real or complex as `Speeds`.
    """
    cutoff = cutoff_hz(at, speed_mm_s)
    first_order = np.exp(at[2]) * cutoff / (cutoff + 1j * frequency_hz)
    delayed: ComplexArray = first_order * np.exp(-2j * np.pi * frequency_hz * at[3])
    return delayed


def curvature_per_hz2(
    at: FloatArray, speed_mm_s: Speeds, frequency_hz: FloatArray | ComplexArray
) -> ComplexArray:
    """Return the second derivative of a law's response by frequency, over the response.

    Parameters
    ----------
    at : ndarray, shape (4,)
        In these coordinates.
    speed_mm_s, frequency_hz : ndarray
        As in `response`.
    """
    pole = 1.0 / (cutoff_hz(at, speed_mm_s) + 1j * frequency_hz)
    curvature: ComplexArray = -np.square(pole + 2.0 * np.pi * at[3]) - np.square(pole)
    return curvature


def inverse(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a covariance or an information, whatever its units.

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
        Symmetric, with a positive diagonal.
    """
    scale = np.sqrt(np.diag(matrix))
    inverted: FloatArray = np.linalg.inv(matrix / np.outer(scale, scale))
    inverted = inverted / np.outer(scale, scale)
    return inverted


def from_law(
    gain_n: float, cutoff_0_hz: float, slope_hz_per_mm_s: float, skew_s: float
) -> FloatArray:
    """Return the coordinates of a law whose cutoff is positive from 20 to 100 mm/s."""
    ends = cutoff_0_hz + slope_hz_per_mm_s * np.array([LOW_MM_S, HIGH_MM_S])
    return np.array([*np.log(ends), np.log(gain_n), skew_s])


def to_law(coordinates: FloatArray) -> tuple[float, float, float, float]:
    """Return gain (N), cutoff at rest (Hz), slope (Hz per mm/s) and delay (s)."""
    low, high = np.exp(coordinates[:2])
    slope = (high - low) / (HIGH_MM_S - LOW_MM_S)
    return (
        float(np.exp(coordinates[2])),
        float(low - slope * LOW_MM_S),
        float(slope),
        float(coordinates[3]),
    )


def law_jacobian(coordinates: FloatArray) -> FloatArray:
    """Return d `MODEL_PARAMETERS` / d coordinates, shape (4, 4)."""
    low, high = np.exp(coordinates[:2])
    span = HIGH_MM_S - LOW_MM_S
    jacobian = np.zeros((SIZE, SIZE))
    jacobian[0, 2] = np.exp(coordinates[2])
    jacobian[1, :2] = low * (1.0 + LOW_MM_S / span), -high * LOW_MM_S / span
    jacobian[2, :2] = -low / span, high / span
    jacobian[3, 3] = 1.0
    return jacobian


def document(
    at: FloatArray,
    covariance: FloatArray,
    participant: str | None,
    validity: Validity,
    provenance: dict[str, Any],
) -> Model:
    """Return a law as a document, with the covariance of its parameters.

    Parameters
    ----------
    at : ndarray, shape (4,)
        In these coordinates.
    covariance : ndarray, shape (4, 4)
    participant : str or None
        Pseudonym.
    validity : Validity
        Speeds and forces at which the law holds.
    provenance : dict
        What is said of it.

    Raises
    ------
    EstimateError
        If the cutoff, continued to rest, is not positive: no such model can be stored.
    """
    gain, cutoff_0, slope, delay = to_law(at)
    if not cutoff_0 > 0.0:
        raise EstimateError(
            f"the cutoff falls to {cutoff_0:.0f} Hz at rest, and a model needs a positive "
            "one; measure longer, or at more distant speeds"
        )
    jacobian = law_jacobian(at)
    matrix = jacobian @ covariance @ jacobian.T
    return Model(
        base=FirstOrderSpeedLaw(gain_n=gain, cutoff_0_hz=cutoff_0, slope_hz_per_mm_s=slope),
        skew_s=delay,
        validity=validity,
        covariance=Covariance(parameters=list(MODEL_PARAMETERS), matrix=matrix.tolist()),
        participant=participant,
        provenance=provenance,
    )


FEWEST: Final = 5
"""Fewer models than this do not tell how people differ; the weak prior is used instead."""
FAR: Final = 2.0
"""Standard deviations from the population for which intervals are made to hold."""
DAY_SD: Final = np.array([0.05, 0.05, 0.10])
"""Standard deviation of ln cutoff and ln gain of one person from one session to the next, as
the simulated participants scatter."""
_WEAK_SD: Final = np.array([0.5, 0.5, 0.6, 200e-6])
_LEAST_SD: Final = np.array([0.03, 0.03, 0.03, 1e-6])
"""People differ by this much, whatever few of them say: the line of a population is bent."""


def of_people(models: Sequence[Model], simulated_rig: bool) -> tuple[Model, ...]:
    """Return the models that say how fingers on a rig differ: on a real one people's alone.

    Parameters
    ----------
    models : sequence of Model
        Of earlier people, and of simulated participants.
    simulated_rig : bool
        On a simulated one all of them are used.
    """
    return tuple(model for model in models if simulated_rig or not model.simulated)


@dataclass(frozen=True, slots=True)
class Prior:
    """A normal prior on a new person's `coordinates`.

    Attributes
    ----------
    mean : ndarray, shape (4,)
    covariance : ndarray, shape (4, 4)
        Of a new person: how people differ, and how well that is known.
    n : int
        Models it was learned from; 0 for the weak one.
    note : str
        Where it comes from, one sentence.
    """

    mean: FloatArray
    covariance: FloatArray
    n: int
    note: str

    @classmethod
    def weak(cls, note: str = "nobody was calibrated before") -> Self:
        """Return the prior of a rig on which too few people were calibrated.

        Centred on the paper's law (Equation 9). Cutoffs spread by a factor of 1.65, mostly
        alike at both ends: three times the spread that the paper's likelihoods imply (15 % of
        the middle cutoff). The delay of a rig's channels is unknown within 0.2 ms, one of
        0.26 ms having been seen.
        """
        law = FirstOrderSpeedLaw(gain_n=0.39, cutoff_0_hz=385.68, slope_hz_per_mm_s=13.811)
        mean = from_law(law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, 0.0)
        correlation = np.eye(SIZE)
        correlation[0, 1] = correlation[1, 0] = 0.8
        return cls(
            mean,
            correlation * np.outer(_WEAK_SD, _WEAK_SD),
            0,
            f"{note}: a weak prior around the paper's law",
        )

    @classmethod
    def learn(cls, models: Sequence[Model]) -> Self:
        """Learn from earlier people's models, one per person.

        Moments: the covariance of the estimates less the mean of their own covariances, and
        then widened by what is not known: by (1 + 1/n) for the mean, by t against normal for
        n - 1 degrees of freedom, by the standard error of what was subtracted, and by a little
        more, so that people who seem alike by chance are not taken for equal. Below `FEWEST`
        models: `weak`.

        Parameters
        ----------
        models : sequence of Model
            Friction models with a covariance; their order does not matter.

        Raises
        ------
        PriorError
            If a model is a placeholder, or not of friction, or has no covariance of its base
            parameters, or if a participant occurs twice.
        """
        known = [_coordinates_of(model) for model in models]
        people = [model.participant for model in models if model.participant is not None]
        twice = sorted({person for person in people if people.count(person) > 1})
        if twice:
            raise PriorError(
                f"more than one model of {', '.join(twice)}: give the newest of each person"
            )
        n = len(known)
        if n < FEWEST:
            return cls.weak(f"{n} earlier models are fewer than {FEWEST}")
        values = np.array([value for value, _ in known])
        own = np.mean([covariance for _, covariance in known], axis=0)
        between = _positive(np.cov(values.T) - own) + own * np.sqrt(2.0 / (n - 1))
        between += np.diag(_LEAST_SD**2)
        ratio = stats.t.ppf(0.975, n - 1) / stats.norm.ppf(0.975)
        mean, covariance = values.mean(axis=0), between * (1.0 + 1.0 / n) * ratio**2
        note = f"learned from {n} earlier models"
        if any(own_covariance[3, 3] <= 0.0 for _, own_covariance in known):
            weak = cls.weak()
            note += "; without their delay, as not all give its variance"
            own_prior = cls(mean, covariance, n, note)
            return own_prior.with_delay(float(weak.mean[3]), float(weak.covariance[3, 3]))
        return cls(mean, covariance, n, note)

    @classmethod
    def of_person(cls, model: Model, population: Self) -> Self:
        """Return what a person's own model says of them today; the delay is the rig's.

        A placeholder, a model of another law, and one without covariance say nothing.

        Parameters
        ----------
        model : Model
            Of friction.
        population : Prior
            Of a person of whom nothing is known; the delay is taken from it.
        """
        try:
            mean, own = _coordinates_of(model)
        except PriorError:
            return population
        covariance = own + np.diag(np.square([*DAY_SD, 0.0]))
        name = model.participant or "nobody in particular"
        prior = cls(mean, covariance, population.n, f"the model in force, of {name}")
        delay_s, variance = population.mean[3], population.covariance[3, 3]
        return prior.with_delay(float(delay_s), float(variance))

    def with_delay(self, delay_s: float, variance: float) -> Self:
        """Return the prior with another delay, on which nothing else depends.

        Parameters
        ----------
        delay_s : float
            Its mean.
        variance : float
            In s².
        """
        mean, covariance = self.mean.copy(), self.covariance.copy()
        mean[3] = delay_s
        covariance[3], covariance[:, 3] = 0.0, 0.0
        covariance[3, 3] = variance
        return replace(self, mean=mean, covariance=covariance)

    @property
    def far_away(self) -> FloatArray:
        """Mean square distance from the mean of people at `FAR`, shape (4, 4).

        Their cutoffs lie so many standard deviations off along the axis on which people differ
        most; otherwise they are as people are. Intervals that count with it hold for them.
        """
        values, vectors = np.linalg.eigh(self.covariance[:2, :2])
        along = self.covariance[:, :2] @ vectors[:, -1] / np.sqrt(values[-1])
        return self.covariance + (FAR**2 - 1.0) * np.outer(along, along)

    @property
    def information(self) -> FloatArray:
        """Inverse of the covariance, shape (4, 4)."""
        return inverse(self.covariance)


def _coordinates_of(model: Model) -> tuple[FloatArray, FloatArray]:
    """Return a model in `coordinates` and its covariance there."""
    name = model.participant or "a population model"
    law = model.base
    if model.placeholder or not isinstance(law, FirstOrderSpeedLaw):
        raise PriorError(f"{name}: only measured friction models can be learned from")
    wanted = MODEL_PARAMETERS
    if model.covariance is None or not set(wanted[:3]) <= set(model.covariance.parameters):
        raise PriorError(f"{name}: no covariance of {', '.join(wanted[:3])}; leave it out")
    if law.cutoff_0_hz + law.slope_hz_per_mm_s * HIGH_MM_S <= 0.0:
        raise PriorError(f"{name}: its cutoff is not positive at {HIGH_MM_S:g} mm/s")
    value = from_law(law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, model.skew_s)
    given = np.array(model.covariance.matrix)
    covariance = np.zeros((SIZE, SIZE))
    where = [
        (row, model.covariance.parameters.index(parameter))
        for row, parameter in enumerate(wanted)
        if parameter in model.covariance.parameters
    ]
    for row, at in where:
        for column, other in where:
            covariance[row, column] = given[at, other]
    inverse = np.linalg.inv(law_jacobian(value))
    return value, inverse @ covariance @ inverse.T


def _positive(covariance: FloatArray) -> FloatArray:
    """Return the nearest covariance without negative variances, in relative units."""
    scale = np.sqrt(np.maximum(np.abs(np.diag(covariance)), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    kept: FloatArray = (vectors * np.maximum(values, 0.0)) @ vectors.T
    nearest: FloatArray = kept * np.outer(scale, scale)
    return nearest
