"""What a test found: figures with unit and uncertainty, a verdict, and what to do."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from scipy.special import stdtrit

from frictus_hardware.arrays import FloatArray


def mean_and_half(values: FloatArray) -> tuple[float, float]:
    """Return the mean of independent estimates and half of its 95 % interval.

    Parameters
    ----------
    values : ndarray, shape (n_estimates,)
        Two or more.
    """
    spread = float(np.std(values, ddof=1))
    return float(np.mean(values)), half_width(spread / math.sqrt(values.size), values.size - 1)


def half_width(standard_error: float, degrees_of_freedom: int) -> float:
    """Return half of the 95 % interval of Student's t."""
    return standard_error * float(stdtrit(degrees_of_freedom, 0.975))


Verdict = Literal["ok", "warn", "fail", "skip"]
WORSE: Final[tuple[Verdict, ...]] = ("skip", "ok", "warn", "fail")


@dataclass(frozen=True, slots=True)
class Measure:
    """One number.

    Attributes
    ----------
    name : str
        Unique among its kind.
    value : float
        In the unit beside it.
    unit : str
        Empty for a plain number.
    uncertainty : float or None
        Half of the 95 % interval, in the unit; None for what is counted.
    """

    name: str
    value: float
    unit: str
    uncertainty: float | None = None

    @property
    def text(self) -> str:
        """The figure as an operator reads it."""
        spread = "" if self.uncertainty is None else f" ± {self.uncertainty:.2g}"
        return f"{self.name} {self.value:.4g}{spread} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True)
class SelftestFinding:
    """Something that is not as it should be.

    Attributes
    ----------
    verdict : {'warn', 'fail'}
    found : str
        What was seen, with figures.
    to_do : str
        What a person should do.
    """

    verdict: Verdict
    found: str
    to_do: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one test found.

    Attributes
    ----------
    test : str
        Name of the test.
    verdict : {'ok', 'warn', 'fail', 'skip'}
    found : str
        What was found, or why the test was skipped.
    to_do : str
        What an operator should do; empty if nothing.
    figures : tuple of Measure
        With their units.
    """

    test: str
    verdict: Verdict
    found: str
    to_do: str = ""
    figures: tuple[Measure, ...] = ()


def judged(
    test: str, figures: Sequence[Measure], remarks: Sequence[SelftestFinding], fine: str
) -> Outcome:
    """Return the outcome of a test: its worst remark's verdict, or that all is fine.

    Parameters
    ----------
    test : str
        Name of the test.
    figures : sequence of Measure
        With their units.
    remarks : sequence of SelftestFinding
        What is not as it should be.
    fine : str
        What to say without a remark.
    """
    if not remarks:
        return Outcome(test, "ok", fine, "", tuple(figures))
    return Outcome(
        test,
        worst(remark.verdict for remark in remarks),
        "; ".join(remark.found for remark in remarks),
        "; ".join(dict.fromkeys(remark.to_do for remark in remarks)),
        tuple(figures),
    )


def lost(test: str, samples: int) -> Outcome:
    """Return the outcome of a test that cannot be judged for want of samples."""
    return Outcome(test, "fail", f"{samples} samples did not get out or in", "see step latency")


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the worst of some verdicts; what was skipped counts least."""
    return max(verdicts, key=WORSE.index, default="skip")


def beyond(size: float, warn: float, fail: float) -> Verdict:
    """Return what a size is worth: up to `warn` it is fine, beyond `fail` it has failed.

    Parameters
    ----------
    size : float
        Not a number fails.
    warn, fail : float
        Bounds of a size, warn at most fail.
    """
    if not size <= fail:
        return "fail"
    return "ok" if size <= warn else "warn"
