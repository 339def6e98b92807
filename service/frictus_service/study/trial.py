"""One trial, and what holds for all trials of a study. `docs/study.md` is the format."""

from dataclasses import dataclass, field
from typing import Literal

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import TransferFunction


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
    """

    rig: str
    carrier_hz: float = 7000.0
    screen_peak_v: float = 75.0
    mount: TransferFunction | None = None
    mount_json: str | None = None
    extras: dict[str, str | int | float] = field(default_factory=dict)


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
        Message tones; empty where there was no drive.
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
