"""The `mount` attribute of a study: JSON whose `lateral` is a transfer function."""

import json
import math
from typing import Any

import numpy as np

from frictus_hardware.physics.linear import TransferFunction
from frictus_service.study.errors import FieldError
from frictus_service.study.trial import StudyInfo

ACCEPTED = (
    'accepted: JSON {"lateral": {"numerator": [...], "denominator": [...]}}, polynomials in s, '
    "highest power first, rad/s; leave the attribute away where there is no mount"
)
GAIN_AT_REST = (0.1, 10.0)


def parse_mount(document: str) -> TransferFunction | None:
    """Return the lateral response of the mount, force to force; None if it names none.

    Parameters
    ----------
    document : str
        The attribute's text.

    Raises
    ------
    FieldError
        If it is not JSON, or `lateral` is not a proper, stable transfer function whose gain at
        rest is 0.1 to 10.
    """
    try:
        parsed = json.loads(document)
    except (ValueError, RecursionError) as error:
        raise FieldError("mount", f"is not JSON ({error}); {ACCEPTED}") from error
    if not isinstance(parsed, dict):
        raise FieldError("mount", f"is not a JSON object; {ACCEPTED}")
    lateral = parsed.get("lateral")
    if lateral is None:
        return None
    if not isinstance(lateral, dict):
        raise FieldError("mount", f"its lateral is not an object; {ACCEPTED}")
    transfer = TransferFunction(
        _polynomial(lateral, "numerator"), _polynomial(lateral, "denominator")
    )
    _check(transfer)
    return transfer


def mount_text(info: StudyInfo) -> str | None:
    """Return the attribute of a study, which `parse_mount` reads; None: no mount."""
    if info.mount_json is not None or info.mount is None:
        return info.mount_json
    lateral = {
        "numerator": list(info.mount.numerator),
        "denominator": list(info.mount.denominator),
    }
    return json.dumps({"lateral": lateral})


def _polynomial(lateral: dict[str, Any], name: str) -> tuple[float, ...]:
    found = lateral.get(name)
    if not isinstance(found, list) or not found:
        raise FieldError("mount", f"lateral.{name} is {found!r}; {ACCEPTED}")
    numeric = all(
        isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        for value in found
    )
    if not numeric:
        raise FieldError("mount", f"lateral.{name} holds other than numbers; {ACCEPTED}")
    return tuple(float(value) for value in found)


def _check(transfer: TransferFunction) -> None:
    if len(transfer.numerator) > len(transfer.denominator) or transfer.denominator[0] == 0.0:
        raise FieldError("mount", f"lateral is not a proper transfer function; {ACCEPTED}")
    if not np.all(np.roots(transfer.denominator).real < 0.0):
        raise FieldError("mount", f"lateral is not stable; {ACCEPTED}")
    at_rest = transfer.denominator[-1]
    gain = transfer.numerator[-1] / at_rest
    if not GAIN_AT_REST[0] <= gain <= GAIN_AT_REST[1]:
        raise FieldError(
            "mount",
            f"lateral has a gain of {gain:.3g} at rest; accepted: {GAIN_AT_REST[0]:g} to "
            f"{GAIN_AT_REST[1]:g}, newton to newton; highest power first, rad/s",
        )
