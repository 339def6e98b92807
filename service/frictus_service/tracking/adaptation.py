"""How far a model may be adapted to the finger while it plays. Pure functions.

A tracker learns gain and cutoff of whoever touches the screen. Everything else of a model, such
as its effects and its delay, belongs to the instrument or was measured on purpose, and a change
of it is never the finger's.
"""

from typing import Any, Final

from frictus.errors import RefusedError
from frictus.messages import LawValues
from frictus.model import FirstOrderSpeedLaw, Model

ADAPT_EVERY_S: Final = 2.0
"""Between two changes of the model."""
ADAPT_WITHIN: Final = 4.0
"""Gain and cutoffs stay within this factor of the model that was set."""
SPEEDS_MM_S: Final = (20.0, 100.0)
"""At which the cutoff is compared: the ends of the range that the paper measured."""
FITTED_TO: Final = "fitted_to"
"""In the provenance: `PERSON`, or the `CONTACT` that a model was adapted to."""
PERSON: Final = "person"
CONTACT: Final = "contact"
_OF_THE_LAW: Final = {"gain_n", "cutoff_0_hz", "slope_hz_per_mm_s"}
_MAY_DIFFER: Final = {
    "base",
    "covariance",
    "validity",
    "provenance",
    "participant",
    "placeholder",  # the tracker has measured what nobody had
}


def law_values(model: Model) -> LawValues | None:
    """Return gain and cutoffs of a model; None where its law has another form.

    Parameters
    ----------
    model : Model
        A `model/1` document.
    """
    base = model.base
    if not isinstance(base, FirstOrderSpeedLaw):
        return None
    slow, fast = (base.cutoff_0_hz + base.slope_hz_per_mm_s * speed for speed in SPEEDS_MM_S)
    return LawValues(gain_n=base.gain_n, cutoff_20_hz=slow, cutoff_100_hz=fast)


def check_adapted(adapted: Model, in_force: Model, as_set: Model) -> None:
    """Refuse a model that is more than the one in force adapted to the finger.

    Parameters
    ----------
    adapted : Model
        What is asked for.
    in_force : Model
        What it would replace; only gain, cutoff, and what tells how they were measured may
        differ from it.
    as_set : Model
        What was set before anything was adapted: gain and cutoffs stay within `ADAPT_WITHIN`
        of it.

    Raises
    ------
    RefusedError
        `not_feasible`; the text names what differs, or what is too far.
    """
    kept, asked = _kept(in_force), _kept(adapted)
    differing = sorted(name for name in kept | asked if kept.get(name) != asked.get(name))
    if differing:
        raise RefusedError(
            "not_feasible",
            f"the adapted model differs from the one in force in {', '.join(differing)}: only "
            "gain_n, cutoff_0_hz and slope_hz_per_mm_s may follow the finger",
        )
    found, reference = law_values(adapted), law_values(as_set)
    if found is None or reference is None:
        raise RefusedError(
            "not_feasible", "only a first-order law with a cutoff over speed can be adapted"
        )
    wanted = reference.model_dump()
    for name, value in found.model_dump().items():
        low, high = wanted[name] / ADAPT_WITHIN, wanted[name] * ADAPT_WITHIN
        if not 0.0 < low <= value <= high:
            raise RefusedError(
                "not_feasible",
                f"{name} of {value:g} is beyond a factor of {ADAPT_WITHIN:g} from the "
                f"{wanted[name]:g} of the model that was set: {low:g} to {high:g} is accepted; "
                "calibrate instead",
            )


def change_of(before: Model, after: Model) -> str:
    """Return gain and cutoffs before and after in words.

    Parameters
    ----------
    before, after : Model
        Of first-order laws.
    """
    was, now = law_values(before), law_values(after)
    if was is None or now is None:
        return "of another form"
    return (
        f"gain {was.gain_n:.3f} to {now.gain_n:.3f} N, "
        f"cutoff at 20 mm/s {was.cutoff_20_hz:.0f} to {now.cutoff_20_hz:.0f} Hz, "
        f"at 100 mm/s {was.cutoff_100_hz:.0f} to {now.cutoff_100_hz:.0f} Hz"
    )


def _kept(model: Model) -> dict[str, Any]:
    """Return what adapting leaves as it is, unknown fields included."""
    base = model.base.model_dump(exclude=_OF_THE_LAW)
    return model.model_dump(exclude=_MAY_DIFFER) | {f"base.{k}": v for k, v in base.items()}
