"""The loop closes: a finger with an effect feels what was asked for once the model has it."""

import numpy as np
import pytest

from frictus.recordings import texture_of
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.motion import Press
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.rendering_error import PlayedStroke, gain_of, thirds
from frictus_service.fidelity.path import walk
from frictus_service.library import SHIPPED

LAW = FrictionLaw()
SCREEN = Screen()
TWICE_REALISTIC = {
    "speed_dependent_cutoff": ("slope_hz_per_mm_s", 9.6),
    "force_dependent_cutoff": ("exponent", 0.36),
    "cutoff_drift": ("per_minute", 0.04),
    "speed_dependent_gain": ("exponent", 0.5),
    "force_dependent_gain": ("exponent", 0.36),
    "gain_drift": ("per_minute", 0.04),
    "direction_asymmetry": ("share", 0.12),
    "position_dependent_gain": ("per_mm", 0.01),
    "charge_leakage": ("corner_hz", 2.0),
    "fractional_rolloff": ("excess_order", 0.24),
    "residual_quadratic": ("share", 0.0096),
    "amplitude_compression": ("share", 0.0096),
}


@pytest.mark.long
def test_the_extended_model_takes_the_error_away(rng: np.random.Generator) -> None:
    flat = texture_of((SHIPPED / "flat.json").read_text(encoding="utf-8"))
    finger = SteadyStrokes(speed_mm_s=90.0, press=Press(target_n=0.3))
    config = SimulatedConfig(finger=finger, seed=int(rng.integers(2**31)))
    strokes = [PlayedStroke(walk(config, 2.2, known=True), 90.0, minutes=15.0)]
    for id_, (name, dose) in TWICE_REALISTIC.items():
        gain = gain_of([(id_, {name: dose})], flat, strokes, LAW, SCREEN)
        assert gain.after.rms_db <= 0.25 * gain.before.rms_db, id_
        assert gain.after.rms_db <= 0.05, id_
        assert gain.after.waveform <= 0.1 * gain.before.waveform, id_
        assert gain.after.clipped_share == 0.0, id_
        assert 0.0 < gain.applied_share <= 1.0, id_


def test_thirds_cover_a_segment() -> None:
    parts = thirds(slice(10, 110))
    assert (parts[0].start, parts[-1].stop) == (10, 110)
    assert [part.stop for part in parts[:-1]] == [part.start for part in parts[1:]]
