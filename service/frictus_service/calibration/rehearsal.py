"""A trial of no finger, judged before the first: what judges trials is compiled by then."""

from dataclasses import replace
from typing import Final

import numpy as np

from frictus_service.calibration.session import reference_x_mm
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

SPEED_MM_S: Final = 60.0
SPAN_MM: Final = (5.0, 95.0)
LAST_S: Final = 4.5
TOUCH_RATE_HZ: Final = 60.0
FRICTION_N: Final = 0.2
RIPPLE: Final = 0.1
"""Of the friction, at the tone."""


def rehearse(info: TrialInfo, study: StudyInfo) -> TrialObservations:
    """Judge ideal strokes as a recorded trial is judged.

    On a new installation that compiles for half a minute. Without it the participant would
    wait so long behind the first trial, with nothing to see.

    Parameters
    ----------
    info : TrialInfo
        Of the trial that comes first; its tones and its sample rate are used.
    study : StudyInfo
        Of the calibration.
    """
    rate_hz = info.sample_rate_hz
    tone_hz = info.tones_hz[0] if info.tones_hz else 100.0
    time_s = np.arange(round(LAST_S * rate_hz)) / rate_hz
    touch_s = np.arange(round(LAST_S * TOUCH_RATE_HZ)) / TOUCH_RATE_HZ
    x_mm = np.array([reference_x_mm(at, SPEED_MM_S, SPAN_MM) for at in touch_s])
    forward = np.sign(np.interp(time_s, touch_s, np.gradient(x_mm)))
    wave = np.sin(2.0 * np.pi * tone_hz * time_s)
    carrier = np.sin(2.0 * np.pi * study.carrier_hz * time_s)
    zero = np.zeros_like(time_s)
    trial = Trial(
        info=replace(info, speed_mm_s=SPEED_MM_S),
        voltage_v=study.screen_peak_v * np.sqrt(0.5 * (1.0 + wave)) * carrier,
        force_n=np.stack(
            [FRICTION_N * (forward + RIPPLE * wave), zero, zero + info.force_n], axis=1
        ),
        accel_m_s2=np.stack([wave, zero, zero + 9.81], axis=1),
        skin_velocity_m_s=None,
        position_mm=np.stack([x_mm, np.zeros_like(x_mm)], axis=1),
        position_t_s=touch_s,
        voltage_source="monitor",
    )
    return observe(trial, study)
