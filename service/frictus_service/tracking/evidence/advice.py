"""What to do about an alarm, in one sentence."""

from typing import Final

import numpy as np

from frictus_hardware.physics.effects import EFFECTS
from frictus_service.discovery.catalogue.cause import NO_UNIT, title
from frictus_service.tracking.evidence.naming import NamedAlarm
from frictus_service.tracking.evidence.signatures import INSTRUMENT, SIZES, EvidencePattern
from frictus_service.tracking.evidence.watch import MAINS

CHECKS: Final = {
    "amplitude_compression": "check that the amplifier is not saturated",
    "charge_leakage": "check the grounding of finger and screen",
    "mount_resonance_shift": "check the mount, and identify it anew with `frictus mount`",
    "position_dependent_gain": "check that the screen is clean and its mount level",
    "residual_quadratic": "check the squaring of the drive and the screen's peak voltage",
}


def advice_of(alarm: NamedAlarm) -> str:
    """Return what an alarm says and what to do.

    Parameters
    ----------
    alarm : NamedAlarm
        With its size so far.
    """
    alike = ""
    if alarm.alike:
        alike = f"; cannot be told from {' and '.join(title(each) for each in alarm.alike)} yet"
    return f"{_said(alarm)}{alike}"


def later(delay_s: float) -> str:
    """Return a delay in words: later, or earlier if it is negative.

    Parameters
    ----------
    delay_s : float
        Of what is sensed, against what a model says.
    """
    return f"{1e6 * abs(delay_s):.0f} us {'later' if delay_s >= 0.0 else 'earlier'}"


def _said(alarm: NamedAlarm) -> str:
    cause, size = alarm.cause, alarm.size
    if cause == "gain":
        return (
            f"The gain is {np.exp(size):.2f} times the model's: calibrate again, or let the "
            "tracker adapt the model"
        )
    if cause == "cutoff":
        return (
            f"The cutoff is {np.exp(size):.2f} times the model's: calibrate again, or let the "
            "tracker adapt the model"
        )
    if cause == "speed_dependent_cutoff":
        return (
            f"The cutoff's slope is {size:+.1f} Hz per mm/s beside the model's: "
            "calibrate again, or let the tracker adapt the model"
        )
    if cause == "delay":
        return (
            f"The force comes {later(size)} than the model says: check the "
            "channels' timing and the anti-aliasing filter; it is not the finger"
        )
    if cause == MAINS:
        return (
            "The force has a line of the mains that is not driven: check the shielding and "
            "grounding of the force sensor"
        )
    if alarm.where is not None:
        return _unknown(alarm.where, size)
    check = CHECKS.get(cause, "")
    then = "run `frictus discover` on a recording"
    sized = f"{title(cause).capitalize()}{_sized(cause, size)}"
    return (
        f"{sized}: {check}, or {then}" if cause in INSTRUMENT and check else f"{sized}: {then}"
    )


def _sized(cause: str, size: float) -> str:
    if cause not in SIZES or not np.isfinite(size):
        return ""
    dose = EFFECTS[cause].parameters[0]
    unit = "" if dose.unit == NO_UNIT else f" {dose.unit}"
    return f", {dose.name.replace('_', ' ')} {size:.2g}{unit} so far"


def _unknown(where: EvidencePattern, size: float) -> str:
    top = "2000" if not np.isfinite(where.high_hz) else f"{where.high_hz:.0f}"
    low = max(where.low_hz, 37.0)
    much = f"{100 * abs(size):.0f} %" if where.part == "modulus" else f"{abs(size):.2f} rad"
    follows = "at all speeds" if where.covariate == "none" else f"with the {where.covariate}"
    return (
        f"No known cause: the {where.part} deviates by {much} from {low:.0f} to {top} Hz "
        f"{follows}; record, and run `frictus discover`"
    )
