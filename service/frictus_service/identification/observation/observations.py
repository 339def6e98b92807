"""What one trial says: a complex response per sweep, third of the stroke and tone."""

from dataclasses import dataclass

from frictus_hardware.arrays import ComplexArray, FloatArray, IntArray
from frictus_service.study.trial import TrialInfo


@dataclass(frozen=True, slots=True)
class ResponseRows:
    """One row per sweep, third of the stroke and tone; arrays of shape (n_rows,).

    Attributes
    ----------
    sweep : ndarray of int
        Number of the sweep in its trial, from 0, in time.
    direction : ndarray of int
        +1 left to right, -1 right to left.
    third : ndarray of int
        0, 1, 2 from the left of the screen to the right.
    speed_mm_s, normal_force_n : ndarray
        Measured means over the segment; the speed without sign.
    position_mm : ndarray
        Middle of the segment on the screen, x.
    tone_hz : ndarray
        Of each row.
    message : ndarray of complex
        Amplitude of the drive fraction at the tone, by least squares on 2 V² / V_pk².
    friction_response : ndarray of complex
        N per unit of drive fraction at the screen: mount, hold and declared skew removed.
    friction_variance : ndarray
        Of its real and of its imaginary part each, from the noise around the tone.
    mobility : ndarray of complex
        Skin velocity per newton of friction on the finger, m/s/N, mount removed; NaN where
        nothing measures the skin.
    mobility_variance : ndarray
        As `friction_variance`.
    """

    sweep: IntArray
    direction: IntArray
    third: IntArray
    speed_mm_s: FloatArray
    normal_force_n: FloatArray
    position_mm: FloatArray
    tone_hz: FloatArray
    message: ComplexArray
    friction_response: ComplexArray
    friction_variance: FloatArray
    mobility: ComplexArray
    mobility_variance: FloatArray


@dataclass(frozen=True, slots=True)
class TrialObservations:
    """What one trial says, and what is wrong with it.

    Attributes
    ----------
    info : TrialInfo
        What was asked of the trial.
    sha256 : str
        Of the trial.
    valid : bool
        Whether it may be used for estimates.
    reasons : tuple of str
        Why not; one sentence each, with figures.
    notes : tuple of str
        What a reader should know of a trial that is used: missing samples and the like.
    mean_speed_mm_s, mean_force_n : float
        Over the sweeps; NaN where nothing was measured.
    rows : ResponseRows
        Empty where there was no drive, or no sweep.
    """

    info: TrialInfo
    sha256: str
    valid: bool
    reasons: tuple[str, ...]
    notes: tuple[str, ...]
    mean_speed_mm_s: float
    mean_force_n: float
    rows: ResponseRows
