"""The sentences of what studies say together."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from frictus_service.discovery.across_studies.document import (
    Alike,
    CauseAcross,
    PooledEstimate,
    SizeInStudy,
    SizesVerdict,
)
from frictus_service.discovery.catalogue.cause import NO_UNIT, title

WHOSE: Final = {
    "instrument": (
        "It is the instrument's by its physics, so that instruments differ in it; measure it "
        "on each rig."
    ),
    "participant": (
        "It is the finger's by its physics, so that people, climate or protocol differ between "
        "studies, or instruments imitate it."
    ),
}
"""What a difference between studies means, by scope."""
PEOPLE_DIFFER: Final = (
    " Some studies have fewer than six people: how people differ is part of this difference."
)
_SAID: Final = {
    "holds_in_all": "holds in all studies",
    "size_differs": "differs in size between studies",
    "in_some_only": "is in some studies only",
    "opposite_signs": "differs in sign between studies",
    "not_shown": "is not shown beside the others",
    "not_tested": "is not tested beside the others",
}


def answer(causes: Sequence[CauseAcross], studies: int) -> str:
    """Return what all studies say together, in a sentence.

    Parameters
    ----------
    causes : sequence of CauseAcross
        Of the catalogue.
    studies : int
        How many are used.
    """
    parts = [
        " or ".join(title(name) for name in (each.id, *(other.id for other in each.alike)))
        + f" {_SAID[each.sizes]}"
        for each in causes
        if each.in_model
    ]
    if not parts:
        return f"{studies} studies together show nothing that the base model gets wrong."
    return f"In {studies} studies together, {'; '.join(parts)}."


def cause_sentence(
    sizes: SizesVerdict,
    scope: str,
    pooled: PooledEstimate | None,
    studies: Sequence[SizeInStudy],
    unit: str,
    alike: Sequence[Alike],
    few_people: bool,
) -> str:
    """Return what is said of a cause.

    Parameters
    ----------
    sizes : str
        What its sizes do.
    scope : {'participant', 'instrument'}
        Whose it is by its physics.
    pooled : PooledEstimate or None
        Over studies.
    studies : sequence of SizeInStudy
        That show it.
    unit : str
        Of its parameter.
    alike : sequence of Alike
        Causes from which it is not told.
    few_people : bool
        Whether blocks of trials stand for people in some study.
    """
    if pooled is None:
        return "Fewer than two studies have a design that shows it."
    names = ", ".join(title(each.id) for each in alike)
    unsure = f"In these designs it cannot be told from {names}. As it: " if alike else ""
    size = shown(pooled.value, pooled.ci95, unit)
    tau = f"tau {shown(pooled.tau, pooled.tau_ci95, unit)}"
    new = ""
    if pooled.prediction95 is not None:
        new = f"; expected in a new laboratory: {_interval(pooled.prediction95, unit)}"
    if sizes == "not_shown":
        return f"Neither a common size nor a difference is seen: {size}, {tau}."
    if sizes == "holds_in_all":
        return f"{unsure}It holds in all studies: {size}{new}; no clear difference, {tau}."
    whose = "" if alike else f" {WHOSE[scope]}"
    differ = f"{tau}{new}.{whose}{PEOPLE_DIFFER if few_people else ''}"
    above, below = (_beyond(studies, sign) for sign in (1.0, -1.0))
    if sizes == "opposite_signs":
        return (
            f"{unsure}Its sign differs: above zero in {', '.join(above)}, below in "
            f"{', '.join(below)}; {differ}"
        )
    if sizes == "in_some_only":
        there = [*above, *below]
        return (
            f"{unsure}It is in some studies only: by their own interval in {len(there)} of "
            f"{len(studies)} ({', '.join(there)}); mean {size}, {differ}"
        )
    return f"{unsure}Its size differs between studies: mean {size}, {differ}"


def _beyond(studies: Sequence[SizeInStudy], sign: float) -> list[str]:
    """Return the studies whose own interval lies on one side of zero."""
    return [each.study for each in studies if min(sign * end for end in each.ci95) > 0.0]


def base_sentence(pooled: PooledEstimate, differs: bool, few_people: bool) -> str:
    """Return what is said of a parameter of the base model.

    Parameters
    ----------
    pooled : PooledEstimate
        Of the logarithm.
    differs : bool
        Whether studies differ beyond what their people explain.
    few_people : bool
        As for `cause_sentence`.
    """
    low, value, high = np.exp((pooled.ci95[0], pooled.value, pooled.ci95[1]))
    tau, least, most = 100.0 * np.expm1(np.array((pooled.tau, *pooled.tau_ci95)))
    beyond = "beyond what their people explain" if differs else "within what people explain"
    return (
        f"{value:.4g} [{low:.4g}, {high:.4g}] times the base model's; studies differ by "
        f"{tau:.3g} % [{least:.3g}, {most:.3g}], {beyond}."
        f"{PEOPLE_DIFFER if differs and few_people else ''}"
    )


def _interval(interval: tuple[float, float], unit: str) -> str:
    low, high = interval
    return f"[{low:.3g}, {high:.3g}]" + ("" if unit == NO_UNIT else f" {unit}")


def shown(value: float, interval: tuple[float, float], unit: str) -> str:
    """Return a value with interval and unit."""
    return f"{value:.3g} {_interval(interval, unit)}"
