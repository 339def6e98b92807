"""One trial, and what holds for all trials of a study. `docs/study.md` is the format."""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from frictus.files import read_bounded
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import Mount, TransferFunction
from frictus_service.errors import FieldError, as_told


@dataclass(frozen=True, slots=True)
class StudyInfo:
    """What holds for every trial of a study.

    Attributes
    ----------
    rig : str
        Its name.
    carrier_hz : float
        Of the screen's voltage.
    screen_peak_v : float
        Screen volts at a drive fraction of 1.
    mount : TransferFunction or None
        Lateral, force to force, rad/s; None where there is none.
    mount_json : str or None
        The attribute as it stands in the file: other axes and named parameters too.
    extras : dict
        Other root attributes, by name; kept, not understood.
    positions_late_s : float or None
        By which positions come late beside the force; their times are without it. None: the
        study does not say.
    """

    rig: str
    carrier_hz: float = 7000.0
    screen_peak_v: float = 75.0
    mount: TransferFunction | None = None
    mount_json: str | None = None
    extras: dict[str, str | int | float] = field(default_factory=dict)
    positions_late_s: float | None = None

    @property
    def simulated(self) -> bool:
        """Whether no finger was measured: the rig said so, or who wrote the study."""
        return bool(self.extras.get("simulated", 0))


@dataclass(frozen=True, slots=True)
class TrialInfo:
    """What was asked of a trial: its attributes in the file.

    Attributes
    ----------
    id : str
        Name of its group; sorts in no meaningful order.
    participant : str
        Pseudonym.
    session, order : int
        Session, and position in the participant's sequence, from 0.
    speed_mm_s, force_n : float
        Targets.
    tones_hz : tuple of float
        Message tones; empty where there was no drive, or a broadband one.
    drive_vpp : float
        Peak to peak at the screen, V.
    sample_rate_hz : float
        Of all sampled data.
    started_utc : str
        ISO 8601.
    """

    id: str
    participant: str
    session: int
    order: int
    speed_mm_s: float
    force_n: float
    tones_hz: tuple[float, ...]
    drive_vpp: float
    sample_rate_hz: float
    started_utc: str


@dataclass(frozen=True, slots=True)
class Trial:
    """What was measured; SI units as the names say, rig frame, missing samples NaN.

    Attributes
    ----------
    info : TrialInfo
        What was asked of the trial.
    voltage_v : ndarray, shape (n_samples,), or None
        At the screen, carrier included; each held from n / fs to (n + 1) / fs. None: no drive.
    force_n : ndarray, shape (n_samples, 3)
        Of the finger on the screen, as the sensor under it reports: same sign as the velocity.
    accel_m_s2 : ndarray, shape (n_samples, 3), or None
        At the nail.
    skin_velocity_m_s : ndarray, shape (n_samples,), or None
        Along x, instead of the acceleration.
    position_mm : ndarray, shape (n_positions, 2)
    position_t_s : ndarray, shape (n_positions,)
        Seconds from the first sample, rising.
    force_skew_s, skin_skew_s : float
        Samples are taken at n / fs + skew: of the force, and of acceleration or velocity.
    voltage_source : {'command', 'monitor'}
    sha256 : str
        Of the trial's content, the same wherever it is stored; empty until it has been stored.
    measured_sha256 : str
        Of its data sets alone, whatever its attributes are; likewise.
    """

    info: TrialInfo
    voltage_v: FloatArray | None
    force_n: FloatArray
    accel_m_s2: FloatArray | None
    skin_velocity_m_s: FloatArray | None
    position_mm: FloatArray
    position_t_s: FloatArray
    force_skew_s: float = 0.0
    skin_skew_s: float = 0.0
    voltage_source: Literal["command", "monitor"] = "command"
    sha256: str = ""
    measured_sha256: str = ""


def row_of(trial: Trial) -> dict[str, Any]:
    """Return names and plain values.

    As in the study file, but the targets are `target_speed_mm_s` and `target_force_n`, apart
    from the force that was measured, and the tones a list, empty where there was no drive.
    """
    info = trial.info
    return {
        "id": info.id,
        "participant": info.participant,
        "session": info.session,
        "order": info.order,
        "target_speed_mm_s": info.speed_mm_s,
        "target_force_n": info.force_n,
        "tone_hz": list(info.tones_hz),
        "drive_vpp": info.drive_vpp,
        "sample_rate_hz": info.sample_rate_hz,
        "started_utc": info.started_utc,
        "voltage_source": trial.voltage_source,
        "force_skew_s": trial.force_skew_s,
        "skin_skew_s": trial.skin_skew_s,
        "sha256": trial.sha256,
    }


ACCEPTED = (
    'accepted: JSON {"lateral": {"numerator": [...], "denominator": [...]}}, polynomials in s, '
    "highest power first, rad/s; leave the attribute away where there is no mount"
)
GAIN_AT_REST = (0.1, 10.0)
MAX_MOUNT_BYTES = 1_000_000
MAX_COEFFICIENTS = 64


def read_mount(named: str | Path) -> TransferFunction | None:
    """Return the lateral response of a mount that an option or a configuration names.

    Parameters
    ----------
    named : str or Path
        ``paper``, ``none``, or a file as `frictus mount` writes it.

    Raises
    ------
    FieldError
        If a file does not hold one.
    OSError
        If there is no such file.
    """
    if named in ("paper", "none"):
        return Mount().lateral if named == "paper" else None
    content = read_bounded(Path(named), MAX_MOUNT_BYTES)
    try:
        return parse_mount(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise FieldError("mount", f"{named} is no text in UTF-8; {ACCEPTED}") from error


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
        raise FieldError("mount", f"lateral.{name} is {as_told(found)}; {ACCEPTED}")
    numeric = all(
        isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        for value in found
    )
    if not numeric:
        raise FieldError("mount", f"lateral.{name} holds other than numbers; {ACCEPTED}")
    if len(found) > MAX_COEFFICIENTS:
        raise FieldError(
            "mount",
            f"lateral.{name} has {len(found)} coefficients, at most {MAX_COEFFICIENTS}: give "
            "the resonances that stand out",
        )
    return tuple(float(value) for value in found)


def _check(transfer: TransferFunction) -> None:
    if len(transfer.numerator) > len(transfer.denominator) or transfer.denominator[0] == 0.0:
        raise FieldError("mount", f"lateral is not a proper transfer function; {ACCEPTED}")
    with np.errstate(over="ignore"):
        monic = np.array(transfer.denominator) / transfer.denominator[0]
    if not np.isfinite(monic).all() or not np.all(np.roots(monic).real < 0.0):
        raise FieldError("mount", f"lateral is not stable; {ACCEPTED}")
    at_rest = transfer.denominator[-1]
    gain = transfer.numerator[-1] / at_rest
    if not GAIN_AT_REST[0] <= gain <= GAIN_AT_REST[1]:
        raise FieldError(
            "mount",
            f"lateral has a gain of {gain:.3g} at rest; accepted: {GAIN_AT_REST[0]:g} to "
            f"{GAIN_AT_REST[1]:g}, newton to newton; highest power first, rad/s",
        )
