"""An exchange held to what every backend promises, before anybody computes with it.

Compiled code reads arrays without looking at their ends, and a monitor that is compared with
what is no number is not compared: neither may depend on who wrote the backend.
"""

import math
import operator
from dataclasses import fields, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange, RigInfo, TouchReport, Truth
from frictus_hardware.errors import BackendError

COUNTS: Final = (
    "first_sample",
    "play_sample",
    "clipped_samples",
    "margin_samples",
    "underrun_samples",
    "overrun_samples",
    "saturated_samples",
)
NUMBERS: Final = (int, float, np.integer, np.floating)


def as_promised(
    exchange: Exchange, n_samples: int, play_sample: int, info: RigInfo
) -> Exchange:
    """Return an exchange whose arrays are of the promised shape and type, or refuse it.

    What a sensor says may be any number, and NaN: the loop looks at that.

    Parameters
    ----------
    exchange : Exchange
        As the backend returned it.
    n_samples : int
        Of the drive that was handed over.
    play_sample : int
        `Backend.next_play_sample` before the exchange.
    info : RigInfo
        Of the backend.

    Raises
    ------
    BackendError
        If it is not as `frictus_hardware.base.Exchange` says; the text says what was returned.
    """
    if not isinstance(exchange, Exchange):
        raise _misfit(info, f"{type(exchange).__name__} from exchange, an Exchange")
    _require_counts(exchange, n_samples, play_sample, info)
    touches = tuple(_as_report(report, info) for report in _touches(exchange, info))
    shapes: dict[str, tuple[int, ...]] = {
        "force_n": (n_samples, 3),
        "accel_m_s2": (n_samples, 3),
        "voltage_v": (n_samples,),
        "applied_v": (n_samples,),
    }
    if info.aux:
        shapes["aux"] = (n_samples, len(info.aux))
    given = {name: getattr(exchange, name) for name in shapes}
    kept = {name: _as_floats(given[name], name, shape, info) for name, shape in shapes.items()}
    if not math.isfinite(float(np.dot(kept["applied_v"], kept["applied_v"]))):
        raise _misfit(info, "applied_v that is not finite, volts")
    if exchange.truth is not None:
        _require_truth(exchange.truth, n_samples, info)
    same = all(map(operator.is_, touches, exchange.touches))
    if same and all(kept[name] is given[name] for name in shapes):
        return exchange
    return replace(exchange, touches=touches, **kept)  # type: ignore[arg-type]


def _misfit(info: RigInfo, what: str) -> BackendError:
    return BackendError(f"the backend {info.backend} returned {what} is accepted")


def _as_floats(
    array: FloatArray, name: str, shape: tuple[int, ...], info: RigInfo
) -> FloatArray:
    """Return an array that compiled code was made ready for: float64, in C order, writable."""
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
        kind = array.dtype if isinstance(array, np.ndarray) else type(array).__name__
        raise _misfit(info, f"{name} of type {kind}, an array of float64")
    if array.shape != shape:
        raise _misfit(info, f"{name} of shape {array.shape}, {shape}")
    return np.require(array, np.float64, ["C", "W"])


def _require_counts(
    exchange: Exchange, n_samples: int, play_sample: int, info: RigInfo
) -> None:
    for name in COUNTS:
        count = getattr(exchange, name)
        if not isinstance(count, int | np.integer) or count < 0:
            raise _misfit(info, f"{name} = {str(count)[:40]}, a whole number from 0 on")
    first, lost = exchange.first_sample, exchange.overrun_samples
    due = play_sample - info.lead_samples
    if not due <= first <= due + lost or lost > first:
        raise _misfit(
            info, f"first_sample {first} with {lost} samples lost, {due} and what was lost"
        )
    if exchange.play_sample != first + info.lead_samples:
        raise _misfit(
            info,
            f"play_sample {exchange.play_sample}, first_sample and the lead, "
            f"{first + info.lead_samples},",
        )
    until = exchange.play_sample + n_samples
    if exchange.underrun_samples > until:
        raise _misfit(
            info,
            f"underrun_samples = {exchange.underrun_samples}, at most the {until} since its "
            "clock began",
        )


def _touches(exchange: Exchange, info: RigInfo) -> tuple[TouchReport, ...]:
    if not isinstance(exchange.touches, tuple):
        kind = type(exchange.touches).__name__
        raise _misfit(info, f"touches of type {kind}, a tuple of TouchReport")
    return exchange.touches


def _as_report(report: TouchReport, info: RigInfo) -> TouchReport:
    """Return a report of Python's own numbers: other kinds have the estimator compiled anew."""
    if isinstance(report, TouchReport):
        place = (report.measured_sample, report.x_mm, report.y_mm)
        kinds = {type(number) for number in place}
        if kinds == {float} and type(report.in_contact) is bool:
            return report
        if all(isinstance(number, NUMBERS) for number in place) and isinstance(
            report.in_contact, bool | np.bool_
        ):
            sample, x_mm, y_mm = map(float, place)
            return TouchReport(sample, x_mm, y_mm, in_contact=bool(report.in_contact))
    raise _misfit(info, f"{str(report)[:120]}, a TouchReport of numbers and of True or False")


def _require_truth(truth: Truth, n_samples: int, info: RigInfo) -> None:
    for field in fields(Truth):
        shape = (
            (n_samples, 2) if field.name in ("position_mm", "velocity_mm_s") else (n_samples,)
        )
        found = getattr(getattr(truth, field.name), "shape", None)
        if found != shape:
            raise _misfit(info, f"truth.{field.name} of shape {found}, {shape}")
