"""One size over studies: a random effect of the study, its heterogeneity, and a new study's.

Sizes are normal about each study's own, which are normal about the mean of all laboratories
with standard deviation tau (DerSimonian & Laird 1986). A study's standard error comes from a
handful of people. Cochran's Q takes it as known, and then 20 studies of 8 people that are alike
differ in a quarter of all cases; Q is therefore referred to Welch's distribution,
which knows each study's degrees of freedom. The interval of the mean is Hartung and Knapp's,
with weights that a study whose few people agree by chance does not win.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import optimize, stats

from frictus_hardware.arrays import FloatArray

LEAST_STUDIES: Final = 2
"""With two, an interval is 13 times its standard error on each side."""
LEAST_TO_PREDICT: Final = 3
STEADY_DEGREES: Final = 8.0
"""How much the median variance of all studies counts in a study's weight, in degrees of
freedom. By its own variance alone, a 5 % test of the mean of 20 studies of 8 people rejects in
8 %."""
_KNOWN: Final = 1e12
"""Degrees of freedom of a variance that is known."""

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class StudySizes:
    """One size in several studies; arrays of shape (n_studies,).

    Attributes
    ----------
    value : ndarray
        Mean over the study's people.
    variance : ndarray
        Of that mean, from how the people scatter. Positive.
    degrees : ndarray
        Of freedom of the variance: people less one.
    """

    value: FloatArray
    variance: FloatArray
    degrees: FloatArray

    @property
    def half_width(self) -> FloatArray:
        """Half the 95 % interval of each study by itself, Student's t."""
        return self._quantile(0.975) * np.sqrt(self.variance)

    @property
    def simultaneous_half_width(self) -> FloatArray:
        """The same of all studies together: 95 % hold all of them (Bonferroni)."""
        return self._quantile(1.0 - 0.025 / self.value.size) * np.sqrt(self.variance)

    def without(self, study: int) -> "StudySizes":
        """Return the sizes of all studies but one."""
        kept = np.arange(self.value.size) != study
        return StudySizes(self.value[kept], self.variance[kept], self.degrees[kept])

    def _quantile(self, level: float) -> FloatArray:
        return np.asarray(stats.t.ppf(level, self.degrees), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class PooledSize:
    """What several studies say of one size.

    Attributes
    ----------
    value, standard_error : float
        Mean of all laboratories.
    ci95 : tuple of float
        Of the mean: Hartung-Knapp, n_studies - 1 degrees of freedom.
    p_mean : float
        That the mean is within the margin.
    tau : float
        Standard deviation between studies.
    tau_ci95 : tuple of float
        By inverting Q (Viechtbauer 2007).
    p_tau : float
        That tau is within the margin.
    q : float
        Cochran's Q.
    i2 : float
        Share of the variance of sizes that is between studies (Higgins & Thompson 2002).
    prediction95 : tuple of float or None
        Where the size of a new laboratory lies (Higgins et al. 2009), n_studies - 2 degrees of
        freedom; None of fewer than three studies.
    """

    value: float
    standard_error: float
    ci95: Interval
    p_mean: float
    tau: float
    tau_ci95: Interval
    p_tau: float
    q: float
    i2: float
    prediction95: Interval | None


def pool(sizes: StudySizes, margin: float = 0.0, *, positive: bool = False) -> PooledSize:
    """Pool one size over studies.

    Parameters
    ----------
    sizes : StudySizes
        Of `LEAST_STUDIES` or more.
    margin : float
        To which measuring is accurate: a mean, or a tau, within it counts as none.
    positive : bool
        The mean is tested for being above the margin, not for being beyond it on either side.

    Raises
    ------
    ValueError
        If there are too few studies.
    """
    count = sizes.value.size
    if count < LEAST_STUDIES:
        raise ValueError(f"{count} studies; accepted: {LEAST_STUDIES} or more")
    tau2 = _between(sizes)
    steady = sizes.degrees * sizes.variance + STEADY_DEGREES * np.median(sizes.variance)
    weight = 1.0 / (steady / (sizes.degrees + STEADY_DEGREES) + tau2)
    mean = _mean(sizes, weight)
    scatter = float(np.sum(weight * (sizes.value - mean) ** 2)) / (count - 1)
    # Studies that agree by chance would make the interval shorter than their own errors allow.
    error = float(np.sqrt(max(scatter, 1.0) / weight.sum()))
    half = float(stats.t.ppf(0.975, count - 1)) * error
    beyond = (mean if positive else abs(mean)) - margin
    upper = float(stats.t.sf(beyond / error, count - 1))
    predicted = None
    if count >= LEAST_TO_PREDICT:
        wide = float(stats.t.ppf(0.975, count - 2)) * float(np.hypot(np.sqrt(tau2), error))
        predicted = (mean - wide, mean + wide)
    known = 1.0 / sizes.variance
    typical = (count - 1) * known.sum() / (known.sum() ** 2 - np.sum(known**2))
    return PooledSize(
        value=mean,
        standard_error=error,
        ci95=(mean - half, mean + half),
        p_mean=upper if positive else min(2.0 * upper, 1.0),
        tau=float(np.sqrt(tau2)),
        tau_ci95=_between_interval(sizes),
        p_tau=_survival(sizes, margin**2),
        q=float(np.sum(known * (sizes.value - _mean(sizes, known)) ** 2)),
        i2=float(tau2 / (tau2 + typical)),
        prediction95=predicted,
    )


def _mean(sizes: StudySizes, weight: FloatArray) -> float:
    return float(np.sum(weight * sizes.value) / weight.sum())


def _welch(sizes: StudySizes, tau2: float) -> tuple[float, float]:
    """Return Welch's F of Q about a given tau, and the degrees of freedom of its denominator.

    Welch (1951). Of a total variance, of which tau's part is known, the degrees of freedom are
    Satterthwaite's.
    """
    count = sizes.value.size
    total = sizes.variance + tau2
    weight = 1.0 / total
    q = float(np.sum(weight * (sizes.value - _mean(sizes, weight)) ** 2))
    degrees = sizes.degrees * (total / sizes.variance) ** 2
    doubt = float(np.sum((1.0 - weight / weight.sum()) ** 2 / degrees)) / (count**2 - 1)
    scale = 1.0 + 2.0 * (count - 2) * doubt
    return q / (count - 1) / scale, min(1.0 / (3.0 * doubt), _KNOWN)


def _survival(sizes: StudySizes, tau2: float) -> float:
    """Return the probability of so large a Q, if the variance between studies is `tau2`."""
    f, degrees = _welch(sizes, tau2)
    return float(stats.f.sf(f, sizes.value.size - 1, degrees))


def _between(sizes: StudySizes) -> float:
    """Return the variance between studies at which Q is as expected (Paule & Mandel 1982)."""

    def excess(tau2: float) -> float:
        f, degrees = _welch(sizes, tau2)
        return f - (degrees / (degrees - 2.0) if degrees > 2.0 else 1.0)

    return _root(excess, sizes)


def _between_interval(sizes: StudySizes) -> Interval:
    low, high = (
        _root(lambda tau2, level=level: level - _survival(sizes, tau2), sizes)  # type: ignore[misc]
        for level in (0.025, 0.975)
    )
    return float(np.sqrt(low)), float(np.sqrt(high))


def _root(falling: Callable[[float], float], sizes: StudySizes) -> float:
    """Return where a falling function of tau squared is zero; 0 where it begins below."""
    if falling(0.0) <= 0.0:
        return 0.0
    high = float(np.ptp(sizes.value) ** 2 + sizes.variance.max())
    while falling(high) > 0.0:
        high *= 4.0
    return float(optimize.brentq(falling, 0.0, high, xtol=1e-9 * high, rtol=1e-9))
