"""A form, and a smooth discrepancy, as the document of a discovery says them."""

from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import FORMS, extended
from frictus_hardware.physics.paths import MEASURED, factor_of, scaled
from frictus_hardware.physics.schedule import Quantity, SlidingConditions
from frictus_hardware.physics.simulator import Simulator
from frictus_service.discovery.beyond.beyond import Beyond, SmoothDiscrepancy
from frictus_service.discovery.beyond.characterise import Characterised, interval_of_mean
from frictus_service.discovery.beyond.form_fit import FittedForm
from frictus_service.discovery.decision.prediction_gain import DB, DEGREES
from frictus_service.discovery.document import (
    COVARIATES,
    CharacterisedForm,
    Covariate,
    Discrepancy,
    DiscrepancyBin,
    ParameterEstimate,
    Rival,
)

_QUANTITIES: Final[dict[Covariate, Quantity]] = {
    "speed": "speed_mm_s",
    "force": "normal_force_n",
    "minutes": "minutes",
    "direction": "direction",
    "position": "position_mm",
}
DRAWN: Final = 60
"""Frequencies of a curve."""


def characterised_forms(beyond: Beyond) -> tuple[CharacterisedForm, ...]:
    """Return the form as the document says it; none where there is none."""
    return () if beyond.form is None else (_said(beyond.form),)


def _said(found: Characterised) -> CharacterisedForm:
    fitted, form = found.fitted, found.fitted.form
    units = {parameter.name: parameter.unit for parameter in FORMS[form.id].parameters}
    low, high = interval_of_mean(found.gain)
    what = sentence(fitted)
    mean = float(found.gain.mean())
    return CharacterisedForm(
        id=form.id,
        statement=(
            f"{what[0].upper()}{what[1:]}, that the base model has not; not in the catalogue; "
            f"explains {found.share:.2f} of what was left; predicts held-out people by "
            f"{mean:.3g} nats each better [{low:.3g}, {high:.3g}]; could be {form.could_be}; "
            f"would be told by {form.told_by}."
        ),
        parameters={
            name: ParameterEstimate(
                value=value,
                ci95=fitted.interval(name) if name in fitted.half_width else None,
                unit=units[name],
            )
            for name, value in fitted.values.items()
        },
        p_value=found.p_value,
        nats_per_person=mean,
        ci95=(low, high),
        share=min(max(found.share, 0.0), 1.0),
        could_be=form.could_be,
        told_by=form.told_by,
        rivals=tuple(Rival(id=each.id, could_be=each.could_be) for each in found.rivals),
    )


def sentence(fitted: FittedForm) -> str:
    """Return what a form is, with its parameters and their intervals."""
    shown = {name: _shown(fitted, name) for name in fitted.half_width}
    by = next((name for name in fitted.form.shapes if name.startswith("by_")), None)
    following = "" if by is None else _following(by, shown[by])
    dose = fitted.values[fitted.form.dose]
    kind = "a notch" if dose < 0.0 else "a resonance"
    return fitted.form.what.format_map({**shown, "following": following, "kind": kind})


def _following(by: str, rate: str) -> str:
    """Return what a dose follows: it stands at the middle of the covariate's scale."""
    covariate = next(each for each in _QUANTITIES if by == f"by_{each}")
    low, high = MEASURED[_QUANTITIES[covariate]]
    unit = COVARIATES[covariate]
    return (
        f" at {0.5 * (low + high):g} {unit}, changing by {rate} of itself from there to "
        f"{high:g} {unit}"
    )


def _shown(fitted: FittedForm, name: str) -> str:
    told = np.array([fitted.values[name], *fitted.interval(name)])
    if name.startswith("log_"):
        told = np.exp(told)  # a factor
    value, low, high = told.tolist()
    return f"{value:.4g} [{low:.4g}, {high:.4g}]"


def discrepancy_of(
    beyond: Beyond, tones_hz: FloatArray, measured: SlidingConditions
) -> Discrepancy | None:
    """Return the smooth discrepancy over frequency and its covariate, with the form's curve.

    Parameters
    ----------
    beyond : Beyond
        What lies beyond the catalogue.
    tones_hz : ndarray
        Of the study: nothing is drawn beyond them.
    measured : SlidingConditions
        Where the study's rows were measured, arrays of shape (n_rows,): nor beyond these.
    """
    smooth = beyond.smooth
    if smooth is None or tones_hz.size < 2:
        return None
    low, high = interval_of_mean(smooth.gain)
    along_hz = np.geomspace(float(tones_hz.min()), float(tones_hz.max()), DRAWN)
    covariate = next((each for each in _QUANTITIES if each == smooth.covariate), None)
    middle = {name: float(np.median(getattr(measured, name))) for name in _QUANTITIES.values()}
    middle["direction"] = 1.0
    return Discrepancy(
        covariate=covariate,
        nats_per_person=float(smooth.gain.mean()),
        ci95=(low, high),
        in_model=beyond.smooth_in_model,
        bins=tuple(
            each
            for level in _levels(covariate, measured)
            for each in _bins(beyond, smooth, along_hz, covariate, level, middle)
        ),
    )


def _levels(covariate: Covariate | None, measured: SlidingConditions) -> tuple[float, ...]:
    """Return lowest, middle and highest level; of no covariate one that means nothing."""
    if covariate is None:
        return (0.0,)
    if covariate == "direction":
        return MEASURED["direction"]
    quantity = _QUANTITIES[covariate]
    followed = np.clip(getattr(measured, quantity), *MEASURED[quantity])
    low, high = float(followed.min()), float(followed.max())
    return (low, 0.5 * (low + high), high)


def _bins(
    beyond: Beyond,
    smooth: SmoothDiscrepancy,
    along_hz: FloatArray,
    covariate: Covariate | None,
    level: float,
    middle: dict[Quantity, float],
) -> list[DiscrepancyBin]:
    quantity = None if covariate is None else _QUANTITIES[covariate]
    around = middle if quantity is None else {**middle, quantity: level}
    at = SlidingConditions(**{name: np.full(along_hz.size, x) for name, x in around.items()})
    x = 1.0 if quantity is None else float(scaled(quantity, at)[0])
    log, half_size, half_phase = smooth.at(along_hz, x)
    form = None if beyond.form is None else _factor(beyond.form.fitted, along_hz, at)
    return [
        DiscrepancyBin(
            level=level,
            tone_hz=float(tone),
            size_db=DB * float(log[k].real),
            half_db=DB * float(half_size[k]),
            phase_deg=DEGREES * float(log[k].imag),
            half_deg=DEGREES * float(half_phase[k]),
            form_db=None if form is None else DB * float(form[k].real),
            form_deg=None if form is None else DEGREES * float(form[k].imag),
        )
        for k, tone in enumerate(along_hz)
    ]


def _factor(fitted: FittedForm, along_hz: FloatArray, at: SlidingConditions) -> FloatArray:
    """Return the logarithm of what a form multiplies the response with."""
    bare = Simulator()
    with_form = extended(bare, [(fitted.form.id, fitted.values)])
    factor = factor_of(with_form.paths, along_hz, at) * np.ones(along_hz.size)
    for simulator, sign in ((with_form, 1.0), (bare, -1.0)):
        gain = simulator.schedule.gain_n(simulator.law, at)
        cutoff = simulator.schedule.cutoff_hz(simulator.law, at)
        factor = factor * (gain / (1.0 + 1j * along_hz / cutoff)) ** sign
    log: FloatArray = np.log(factor)
    return log
