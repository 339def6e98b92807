"""What the rows of a log say: thresholds, exponents, settings and similarities by condition."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from frictus.errors import ArgumentError
from frictus.experiment.protocol import Protocol
from frictus.experiment.psychometrics.fitting import Estimate, PsychometricFit, fit
from frictus.experiment.stimuli import Difference, Pairs
from frictus.experiment.tasks import guess_rate
from frictus.experiment.trial_row import status_of


@dataclass(frozen=True, slots=True)
class ConditionResult:
    """What the trials of a condition say; what does not apply is None.

    Attributes
    ----------
    condition : str
        Its name.
    trials : int
        Answered and felt, practice apart.
    refused, flagged : int
        Trials that the rig could not render whole, and answered ones with any flag.
    catch_right : tuple of int or None
        Catch trials answered rightly, and all of them.
    unit : str
        Of the level.
    not_felt : int
        Trials without contact or motion of the finger, which count for nothing.
    limited : int
        Settings at the end of what can be set or rendered, with a wish for more.
    fit : PsychometricFit or None
        Of choices.
    exponent : Estimate or None
        Of Stevens' power law, of magnitudes: of one interval over its amplitude, of two over
        the level.
    setting : Estimate or None
        Geometric mean of the levels set.
    ratings : dict of str to float or None
        Mean number or share of "different" of each pair, by ``first|second``.
    undetermined : str
        Why magnitudes have no exponent, or settings no mean; else empty.
    """

    condition: str
    trials: int
    refused: int
    flagged: int
    catch_right: tuple[int, int] | None
    unit: str
    not_felt: int = 0
    limited: int = 0
    fit: PsychometricFit | None = None
    exponent: Estimate | None = None
    setting: Estimate | None = None
    ratings: dict[str, float] | None = None
    undetermined: str = ""

    def fields(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return asdict(self)


def results(protocol: Protocol, rows: list[dict[str, Any]]) -> list[ConditionResult]:
    """Return what a log says of each condition that has answers.

    Parameters
    ----------
    protocol : Protocol
        The experiment.
    rows : list of dict
        Of its log.

    Raises
    ------
    ArgumentError
        If a row lacks what a trial has.
    """
    try:
        main = [row for row in rows if row.get("phase") == "main" and "status" in row]
        found = []
        for name in protocol.conditions:
            mine = [row for row in main if row["condition"] == name]
            if any(row["status"] == "answered" for row in mine):
                found.append(_result(protocol, name, mine))
    except ArgumentError:
        raise
    except (LookupError, TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"a row of the log is no trial: {error!r}") from error
    return found


def _result(protocol: Protocol, name: str, rows: list[dict[str, Any]]) -> ConditionResult:
    felt = [row for row in rows if status_of(row["flags"]) == "answered"]
    answered = [row for row in felt if row["status"] == "answered"]
    # A number is neither right nor wrong.
    catch = [row for row in answered if row["catch"] and row["correct"] is not None]
    stimulus, task = protocol.conditions[name], protocol.task
    base = ConditionResult(
        name,
        len(answered),
        sum(row["status"] == "refused" for row in rows),
        sum(bool(row["flags"]) for row in answered),
        (sum(bool(row["correct"]) for row in catch), len(catch)) if catch else None,
        stimulus.unit,
        len(rows) - len(felt),
        sum("limited" in row["flags"] for row in answered),
    )
    values = asdict(base)
    if isinstance(stimulus, Pairs):
        values["ratings"] = _ratings(stimulus, answered)
    elif task.kind == "magnitude":
        rated = [row for row in answered if row["level_rendered"] > 0.0]
        numbers = [float(row["response"]) for row in rated]
        levels = [row["level_rendered"] for row in rated]
        if isinstance(stimulus, Difference) and task.intervals == 1:  # a law of amplitudes
            levels = [10.0 ** (level / 20.0) for level in levels]
        zeros = sum(number <= 0.0 for number in numbers)
        if zeros:
            values["undetermined"] = (
                f"no exponent: {zeros} of {len(numbers)} numbers are 0, of which a power law "
                "has none; ask for numbers above 0, or fit another law to the log"
            )
        elif len(numbers) < 3 or len(set(levels)) < 2:
            values["undetermined"] = (
                "no exponent: it takes 3 numbers, of two levels above 0 or more"
            )
        else:
            values["exponent"] = power_law_exponent(levels, numbers)
    elif task.kind == "adjustment":
        levels = [row["level_rendered"] for row in answered if row["level_rendered"] > 0.0]
        if len(levels) > 1:
            values["setting"] = geometric_mean(levels)
        else:
            values["undetermined"] = "no mean: it takes two settings above 0"
    else:
        usable = [row for row in answered if "level lost" not in row["flags"]]
        levels = [row["level_rendered"] for row in usable]
        if any(level > 0.0 for level in levels):
            positive = [row["positive"] for row in usable]
            values["fit"] = fit(levels, positive, guess_rate(task))
    return ConditionResult(**values)


def _ratings(stimulus: Pairs, rows: list[dict[str, Any]]) -> dict[str, float]:
    """Return the mean answer of each pair, whatever its order."""
    answers: dict[str, list[float]] = {}
    for row in rows:
        value = row["response"] if row["positive"] is None else row["positive"]
        names = stimulus.names(row["level"])
        answers.setdefault("|".join(names), []).append(float(value))
    return {pair: float(np.mean(values)) for pair, values in sorted(answers.items())}


def power_law_exponent(
    levels: ArrayLike, numbers: ArrayLike, confidence: float = 0.95
) -> Estimate:
    """Return the exponent of Stevens' power law by regression of logarithms.

    Parameters
    ----------
    levels, numbers : array_like, shape (n_trials,)
        Above 0; at least 3, of two levels or more.
    confidence : float
        Of the interval, 0.5 to 0.999.
    """
    x, y = np.log10(levels), np.log10(numbers)
    centred = x - np.mean(x)
    spread = float(np.sum(centred**2))
    slope = float(np.sum(centred * y) / spread)
    residual = y - np.mean(y) - slope * centred
    error = math.sqrt(float(np.sum(residual**2)) / (x.size - 2) / spread)
    half = student_quantile(0.5 + confidence / 2.0, x.size - 2) * error
    return Estimate(slope, slope - half, slope + half)


def geometric_mean(levels: ArrayLike, confidence: float = 0.95) -> Estimate:
    """Return the geometric mean of levels that were set, with Student's interval.

    Parameters
    ----------
    levels : array_like, shape (n_settings,)
        Above 0, at least 2.
    confidence : float
        Of the interval, 0.5 to 0.999.
    """
    x = np.log10(levels)
    half = student_quantile(0.5 + confidence / 2.0, x.size - 1) * float(np.std(x, ddof=1))
    half /= math.sqrt(x.size)
    mean = float(np.mean(x))
    return Estimate(10.0**mean, 10.0 ** (mean - half), 10.0 ** (mean + half))


def student_quantile(share: float, freedom: int) -> float:
    """Return a quantile of Student's t, from its density over atan(t / sqrt(freedom)).

    Parameters
    ----------
    share : float
        0.5 up to, not with, 1.
    freedom : int
        Degrees of freedom, 1 or above.
    """
    angle = np.linspace(0.0, 0.5 * np.pi, 20_001)
    density = np.cos(angle) ** (freedom - 1)
    steps = 0.5 * (density[1:] + density[:-1])
    cumulative = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.interp(2.0 * share - 1.0, cumulative / cumulative[-1], angle)
    return math.sqrt(freedom) * math.tan(float(at))
