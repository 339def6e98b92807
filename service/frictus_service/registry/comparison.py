"""What differs between two models, and whether by more than their uncertainties."""

import math
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frictus.model import FirstOrderSpeedLaw, Model, Validity
from frictus_service.errors import ComparisonError
from frictus_service.registry.documents import Published, VersionSummary

SPEEDS_MM_S: Final = (20.0, 40.0, 60.0, 80.0, 100.0)
_Z95: Final = 1.959964


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True)


class ComparedQuantity(_Document):
    """A quantity in both models, and how far they are apart, `b` less `a`."""

    a: float
    b: float
    difference: float
    relative: Annotated[float | None, Field(description="Of `a`; null where `a` is 0")]
    standard_error: Annotated[
        float | None, Field(description="Of the difference; null without both covariances")
    ]
    ci95: tuple[float, float] | None = None
    z: Annotated[float | None, Field(description="Difference over its standard error")] = None


class CutoffDifference(ComparedQuantity):
    """The cutoff at one speed, Hz."""

    speed_mm_s: float
    within_validity: tuple[bool, bool]
    """Of `a` and of `b`."""


class Comparison(_Document):
    """Two published models, side by side.

    Intervals take the two models for independent: they are too wide for two analyses of one
    study, whose errors are shared.
    """

    a: VersionSummary
    b: VersionSummary
    response: Literal["friction", "mobility"]
    parameters: dict[str, ComparedQuantity]
    cutoff_hz: Annotated[list[CutoffDifference], Field(description="Friction models only")]
    validity: tuple[Validity, Validity]
    effects: Annotated[
        dict[str, Literal["a", "b", "both", "both, with other parameters"]],
        Field(description="Which model has it"),
    ]
    provenance: Annotated[
        dict[str, tuple[Any, Any]], Field(description="Only what differs, of `a` and of `b`")
    ]


def compare(a: Published, b: Published) -> Comparison:
    """Set two published models side by side.

    Parameters
    ----------
    a, b : Published
        Of the same response. Where both carry a covariance, differences have standard errors;
        the cutoff's follow from those of ``cutoff_0_hz`` and ``slope_hz_per_mm_s``.

    Raises
    ------
    ComparisonError
        If one is of friction and the other of mobility.
    """
    if a.model.response != b.model.response:
        raise ComparisonError(
            f"{a.reference} is a model of {a.model.response}, {b.reference} of "
            f"{b.model.response}: they have no parameter in common"
        )
    values_a, values_b = _values(a.model), _values(b.model)
    variances = {
        name: (_variance(a.model, {name: 1.0}), _variance(b.model, {name: 1.0}))
        for name in values_a
    }
    told = [published.model.provenance for published in (a, b)]
    return Comparison(
        a=_summary(a),
        b=_summary(b),
        response=a.model.response,
        parameters={
            name: _difference(values_a[name], values_b[name], *variances[name])
            for name in values_a
        },
        cutoff_hz=_cutoffs(a.model, b.model),
        validity=(a.model.validity, b.model.validity),
        effects=_effects(a.model, b.model),
        provenance={
            key: (told[0].get(key), told[1].get(key))
            for key in sorted({*told[0], *told[1]})
            if told[0].get(key) != told[1].get(key)
        },
    )


def _summary(published: Published) -> VersionSummary:
    return VersionSummary.model_validate(published.model_dump(exclude={"model"}))


def _values(model: Model) -> dict[str, float]:
    base = type(model.base).model_fields
    values = {name: float(getattr(model.base, name)) for name in base if name != "law"}
    return {**values, "skew_s": model.skew_s}


def _variance(model: Model, weights: dict[str, float]) -> float | None:
    """Return the variance of a weighted sum of parameters; None if they have no covariance."""
    if model.covariance is None:
        return None
    names = model.covariance.parameters
    if not set(weights) <= set(names):
        return None
    weight = np.array([weights.get(name, 0.0) for name in names])
    return float(weight @ np.asarray(model.covariance.matrix) @ weight)


def _difference(
    a: float, b: float, var_a: float | None, var_b: float | None
) -> ComparedQuantity:
    difference = b - a
    relative = difference / a if a != 0.0 else None
    if var_a is None or var_b is None or not var_a + var_b > 0.0:
        return ComparedQuantity(
            a=a, b=b, difference=difference, relative=relative, standard_error=None
        )
    error = math.sqrt(var_a + var_b)
    return ComparedQuantity(
        a=a,
        b=b,
        difference=difference,
        relative=relative,
        standard_error=error,
        ci95=(difference - _Z95 * error, difference + _Z95 * error),
        z=difference / error,
    )


def _cutoffs(a: Model, b: Model) -> list[CutoffDifference]:
    if not isinstance(a.base, FirstOrderSpeedLaw) or not isinstance(b.base, FirstOrderSpeedLaw):
        return []
    found = []
    for speed in SPEEDS_MM_S:
        weights = {"cutoff_0_hz": 1.0, "slope_hz_per_mm_s": speed}
        difference = _difference(
            a.base.cutoff_0_hz + a.base.slope_hz_per_mm_s * speed,
            b.base.cutoff_0_hz + b.base.slope_hz_per_mm_s * speed,
            _variance(a, weights),
            _variance(b, weights),
        )
        (low_a, high_a), (low_b, high_b) = a.validity.speed_mm_s, b.validity.speed_mm_s
        within = (low_a <= speed <= high_a, low_b <= speed <= high_b)
        found.append(
            CutoffDifference(
                **difference.model_dump(), speed_mm_s=speed, within_validity=within
            )
        )
    return found


def _effects(a: Model, b: Model) -> dict[str, Any]:
    own = [{effect.id: effect.parameters for effect in model.effects} for model in (a, b)]
    found = {}
    for name in sorted({*own[0], *own[1]}):
        if name not in own[1]:
            found[name] = "a"
        elif name not in own[0]:
            found[name] = "b"
        else:
            same = own[0][name] == own[1][name]
            found[name] = "both" if same else "both, with other parameters"
    return found
