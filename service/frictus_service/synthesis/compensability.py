"""From a `model/1` document to the law that is rendered with, and what of it can be undone.

Which of a model's effects can be undone, how, and why the others cannot.

No effect is known here by its name: what one does is read off the simulator that it extends.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Final

import numpy as np

from frictus.errors import TextureError
from frictus.model import FirstOrderSpeedLaw, Model
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import RigInfo
from frictus_hardware.errors import EffectParameterError
from frictus_hardware.physics.effects import KNOWN, extended
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.paths import MEASURED, ParallelPath
from frictus_hardware.physics.screen import DriveMap, Screen
from frictus_hardware.physics.simulator import Simulator
from frictus_service.synthesis.compensation import (
    FORGET_HZ,
    CompensationRemark,
    Inverse,
    Ranges,
)
from frictus_service.synthesis.path_compensation import can_be_undone

Parameters = Mapping[str, float]

NOT_FELT: Final = "it changes what a sensor says, not what the finger feels"
NOT_FRICTION: Final = "it is how the skin moves, not what friction it feels"
FOLDED: Final = "more drive does not always give more friction, so there is no one inverse"
NO_PATH: Final = "at its strongest the drive along it cancels the drive itself"
NO_LEAK: Final = "only a leak with one corner can be made good"
REASONS: Final[Mapping[str, str]] = {
    "mount": NOT_FELT,
    "normal_mount": NOT_FELT,
    "hum": NOT_FELT,
    "skin": NOT_FRICTION,
    "skin_delay_s": NOT_FRICTION,
    "delay_s": "all of the friction comes so much later, which nothing that is played changes",
    "stick_slip": "its phase is the finger's own and cannot be foretold",
}
"""Why a part of the simulator that an effect changes is not undone."""

TABLE_POINTS: Final = 1025


def inverse_of(
    law: FrictionLaw,
    effects: Sequence[tuple[str, Parameters]],
    ranges: Ranges = Ranges(),  # noqa: B008 - frozen
) -> Inverse:
    """Return the inverse of a law with effects, with remarks on what it leaves out.

    Parameters
    ----------
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    effects : sequence of (id, parameters)
        As a `model/1` lists them. One of an unknown id is left out, and that is remarked.
    ranges : Ranges

    Raises
    ------
    EffectParameterError
        If a parameter is missing, unknown or out of its range.
    """
    known = [(id_, parameters) for id_, parameters in effects if id_ in KNOWN]
    whole = extended(Simulator(law=law), known)
    remarks = [
        CompensationRemark(id_, rendered=False, text="this version does not know it")
        for id_, _ in effects
        if id_ not in KNOWN
    ]
    for id_, parameters in known:
        alone = extended(Simulator(law=law), [(id_, parameters)])
        remarks += _remarks(id_, alone, whole, ranges)
    table = _table(whole.drive_map)
    return Inverse(
        law=law,
        schedule=whole.schedule,
        excess_order=whole.excess_order,
        leak_hz=_leak_hz(whole.drive_filter) or 0.0,
        drive_table=np.zeros(0) if table is None else table,
        paths=_undone_paths(whole, ranges),
        ranges=ranges,
        remarks=tuple(remarks),
    )


def _remarks(
    id_: str, alone: Simulator, whole: Simulator, ranges: Ranges
) -> list[CompensationRemark]:
    """Return what is to be said of one effect, from the simulator that has no other."""
    bare = Simulator(law=alone.law)
    remarks = [
        CompensationRemark(id_, rendered=False, text=REASONS[field.name])
        for field in fields(Simulator)
        if field.name in REASONS and getattr(alone, field.name) != getattr(bare, field.name)
    ]
    if alone.drive_map != bare.drive_map and _table(whole.drive_map) is None:
        remarks.append(CompensationRemark(id_, rendered=False, text=FOLDED))
    if alone.drive_filter is not None and _leak_hz(whole.drive_filter) is None:
        remarks.append(CompensationRemark(id_, rendered=False, text=NO_LEAK))
    elif alone.drive_filter is not None:
        text = (
            f"a constant drive, the bias too, and what is slower than {FORGET_HZ:g} Hz is lost"
        )
        remarks.append(CompensationRemark(id_, rendered=True, text=text))
    if _undone_paths(alone, ranges) != alone.paths:
        remarks.append(CompensationRemark(id_, rendered=False, text=NO_PATH))
    inverse = Inverse(alone.law, alone.schedule, ranges=ranges)
    if _varies_with(inverse, "minutes"):
        text = f"followed for {ranges.minutes[1]:g} min from when the model came into force"
        remarks.append(CompensationRemark(id_, rendered=True, text=text))
    if _varies_with(inverse, "normal_force_n"):
        low, high = ranges.force_n
        text = f"follows the force as last measured, from {low:g} to {high:g} N"
        remarks.append(CompensationRemark(id_, rendered=True, text=text))
    return remarks


def _undone_paths(simulator: Simulator, ranges: Ranges) -> tuple[ParallelPath, ...]:
    # A dose follows the speed beyond where the law holds.
    everywhere = ranges.everywhere(MEASURED["speed_mm_s"])
    return tuple(path for path in simulator.paths if can_be_undone(path, everywhere))


def _varies_with(inverse: Inverse, quantity: str) -> bool:
    everywhere = inverse.ranges.everywhere(inverse.law.speed_range_mm_s)
    value = getattr(everywhere, quantity)
    held = replace(everywhere, **{quantity: np.full_like(value, value.flat[0])})
    return any(
        not np.array_equal(there, here)
        for there, here in zip(inverse.along(everywhere), inverse.along(held), strict=True)
    )


def _leak_hz(response: TransferFunction | None) -> float | None:
    """Return the corner of ``s / (s + w)``, 0 for no filter, None for any other."""
    if response is None:
        return 0.0
    match response.numerator, response.denominator:
        case (1.0, 0.0), (1.0, corner_rad_s):
            return corner_rad_s / (2.0 * math.pi)
    return None


def _table(drive_map: DriveMap) -> FloatArray | None:
    """Return the drive over what becomes of it; empty for no change, None without inverse."""
    if drive_map == DriveMap():
        return np.zeros(0)
    given = np.linspace(0.0, 1.0, 8 * (TABLE_POINTS - 1) + 1)
    got = given * drive_map.factor(given)
    if not np.all(np.diff(got) > 0.0):
        return None
    table: FloatArray = np.interp(np.linspace(0.0, 1.0, TABLE_POINTS), got, given)
    return table


def law_of(model: Model) -> FrictionLaw:
    """Return the friction law that a model states.

    Raises
    ------
    TextureError
        If the model is not one of friction: nothing can be rendered with it.
    """
    if not isinstance(model.base, FirstOrderSpeedLaw):
        raise TextureError(
            f"a {model.base.law!r} model says how the skin moves, not what friction it feels; "
            "give one with response 'friction'"
        )
    low, high = model.validity.speed_mm_s
    return FrictionLaw(
        model.base.gain_n, model.base.cutoff_0_hz, model.base.slope_hz_per_mm_s, (low, high)
    )


def inverse_of_model(model: Model, screen: Screen) -> Inverse:
    """Return what has to be undone so that a finger on a screen feels what is asked for.

    Raises
    ------
    TextureError
        If the model is not one of friction, or an effect has a parameter out of its range.
    """
    low, high = model.validity.normal_force_n
    effects = [(effect.id, effect.parameters) for effect in model.effects]
    try:
        return inverse_of(law_of(model), effects, Ranges((low, high), (0.0, screen.size_mm[0])))
    except EffectParameterError as error:
        raise TextureError(str(error)) from error


def placeholder_model() -> Model:
    """Return the model that stands in until somebody has measured one; it says so."""
    law = FrictionLaw()
    return Model(
        base=FirstOrderSpeedLaw(
            gain_n=law.gain_n,
            cutoff_0_hz=law.cutoff_0_hz,
            slope_hz_per_mm_s=law.slope_hz_per_mm_s,
        ),
        placeholder=True,
        provenance={"source": "published population values; nobody measured this rig"},
    )


def screen_of(info: RigInfo) -> Screen:
    """Return the screen that a backend drives."""
    return Screen(peak_v=info.screen_peak_v, size_mm=info.screen_mm)
