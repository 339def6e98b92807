"""What ranks first in one recording, in words."""

from collections.abc import Callable, Sequence
from typing import Final

from frictus_service.discovery.catalogue.cause import NO_UNIT, title
from frictus_service.discovery.catalogue.causes import cause_of, separating_experiment
from frictus_service.discovery.document import ParameterEstimate, RankedModel

Parameters = dict[str, ParameterEstimate]
NEARLY: Final = 4.0
"""AIC by which two models differ that are not told apart (Burnham and Anderson, 2002)."""

MOSTLY: Final = 0.5
"""Share of the misfit from which a cause is said to explain it."""


def _interval(estimate: ParameterEstimate, times: float = 1.0, unit: str = "") -> str:
    """Return a value with its interval, in another unit."""
    value = f"{times * estimate.value:.3g}{unit}"
    if estimate.ci95 is None:
        return value
    low, high = sorted(times * end for end in estimate.ci95)
    return f"{value} [{low:.3g}, {high:.3g}]"


_PHRASES: Final[dict[str, Callable[[Parameters], str]]] = {
    "channel_delay": lambda p: (
        f"a delay of {_interval(p['delay_s'], 1e3, ' ms')} between the channels"
        + (" (what should follow comes first)" if p["delay_s"].value < 0.0 else "")
    ),
    "second_mode": lambda p: (
        f"a second mode of the skin near {p['frequency_hz'].value:.3g} Hz, of "
        f"{_interval(p['share'])} of the first one's peak"
    ),
    "mount_resonance_shift": lambda p: (
        f"a mount that resonates {_interval(p['share'], 100.0, ' %')} above what the study says"
    ),
    "charge_leakage": lambda p: (
        f"charge that leaks below a corner of {_interval(p['corner_hz'], 1.0, ' Hz')}"
    ),
    "fractional_rolloff": lambda p: (
        f"a roll-off whose order is {_interval(p['excess_order'])} above one"
    ),
}


def described(causes: dict[str, Parameters]) -> str:
    """Return causes and their parameters as a noun phrase."""
    return " with ".join(_phrase(name, found) for name, found in causes.items())


def _phrase(name: str, found: Parameters) -> str:
    if name in _PHRASES:
        return _PHRASES[name](found)
    values = [
        _interval(each, unit="" if each.unit == NO_UNIT else f" {each.unit}")
        for each in found.values()
    ]
    return f"{title(name)} ({', '.join(values)})"


def statement_of(models: Sequence[RankedModel], *, beyond: bool) -> str:
    """Return the answer: what explains the recording, and what would confirm it.

    Parameters
    ----------
    models : sequence of RankedModel
        Best first.
    beyond : bool
        Whether the first says more than chance gives.
    """
    first = models[0]
    if not beyond:
        return (
            "In this recording only: no cause explains more than the base model does, beyond "
            f"what chance gives.{_best_tried(models)}"
        )
    what = described(first.parameters)
    alone = len(first.causes) == 1
    verb, rest = ("explains it" if alone else "explain it together"), ""
    if first.explained is not None and first.explained < MOSTLY:
        verb = "explains a part of it" if alone else "explain a part of it together"
        rest = " What stays is scatter, or has another cause."
    confirmed = " ".join(cause_of(name).next_experiment for name in first.causes)
    return (
        f"In this recording only, {what} {verb}: {taken_away(first)} of the mean "
        "square that the base model leaves in held-out folds of time."
        f"{rest}{_rival(models)} It would be confirmed by this: {confirmed}"
    )


def taken_away(model: RankedModel) -> str:
    """Return the share of the held-out misfit that a model of one recording takes away."""
    return "unknown" if model.explained is None else f"{100.0 * model.explained:.3g} %"


def _best_tried(models: Sequence[RankedModel]) -> str:
    tried = [model for model in models if model.causes]
    if not tried:
        return ""
    best = max(tried, key=lambda model: model.heldout_loglik)
    return (
        f" Best of what was tried: {' with '.join(map(title, best.causes))}, which takes away "
        f"{taken_away(best)} of what it leaves in held-out folds of time."
    )


def _rival(models: Sequence[RankedModel]) -> str:
    """Return what explains it nearly as well by another cause; empty where nothing does."""
    first = models[0]
    for model in models[1:]:
        others = [name for name in model.causes if name not in first.causes]
        near = model.aic - first.aic < NEARLY and len(model.causes) <= len(first.causes)
        if near and others:
            experiment = separating_experiment(first.causes[0], others[0])
            return f" {title(others[0]).capitalize()} does nearly as well. {experiment}"
    return ""
