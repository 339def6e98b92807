"""How much people differ: residual and between-participant spread from likelihoods.

The paper gives no standard deviations, but -2 log-likelihoods of models with and without a
random intercept of the participant (Sections 3.1 and 3.2). For J participants with n conditions
each, N = n J, both follow from the two variances alone::

    reduced = N ln(s^2)                                  + N (1 + ln 2 pi)
    full    = N ln(se^2) + J ln(1 + n sb^2 / se^2)       + N (1 + ln 2 pi)

with ``s^2 = se^2 + sb^2``, at the maximum of the likelihood. Two equations, two unknowns.
"""

import math
from dataclasses import dataclass

from scipy import optimize

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


def likelihoods(
    spread: MeasurementSpread, participants: int = PARTICIPANTS, conditions: int = CONDITIONS
) -> Likelihoods:
    """Return the -2 log-likelihoods that a spread gives rise to.

    Parameters
    ----------
    spread : MeasurementSpread
        Between and within people.
    participants, conditions : int
        Number of participants, and of conditions of each.
    """
    count = participants * conditions
    constant = count * (1.0 + math.log(2.0 * math.pi))
    within, between = spread.residual**2, spread.between**2
    clustered = participants * math.log(1.0 + conditions * between / within)
    return Likelihoods(
        reduced=constant + count * math.log(within + between),
        full=constant + count * math.log(within) + clustered,
    )


def spread_of(
    found: Likelihoods, participants: int = PARTICIPANTS, conditions: int = CONDITIONS
) -> MeasurementSpread:
    """Return the spread behind two -2 log-likelihoods, the inverse of `likelihoods`.

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
