"""Linearity of a calibration's trials: found from the sweeps, noted where it matters."""

import numpy as np
import pytest

from frictus_hardware.physics.friction import FrictionLaw
from frictus_service.calibration import design
from frictus_service.calibration.checks import linearity_of, stretches_of
from frictus_service.study.trial import Trial, TrialInfo
from frictus_service.synthesis.scene import compile_excitation

RATE_HZ = 20_000.0
SWEEP_S, SWEEPS = 1.2, 4


def trial(
    rng: np.random.Generator, square: float = 0.0, cube: float = 0.0, lost: slice = slice(0)
) -> Trial:
    """Return strokes of 60 mm, back and forth, with a friction that follows the drive."""
    excitation = design.multisine(rng, design.lines(12))
    table = compile_excitation(excitation, FrictionLaw(), RATE_HZ).table - 0.5
    n = round(SWEEPS * SWEEP_S * RATE_HZ)
    drive = np.resize(table, n)
    friction = 0.3 * (drive + square * drive**2 + cube * drive**3)
    sign = np.where(np.arange(n) // round(SWEEP_S * RATE_HZ) % 2 == 0, 1.0, -1.0)
    force = rng.normal(0.0, 0.002, (n, 3))
    force[:, 0] += sign * (0.2 + friction)
    force[:, 2] += 0.4
    force[lost] = np.nan
    at_s = np.arange(0.0, SWEEPS * SWEEP_S, 1.0 / 60.0)
    cycle = at_s / SWEEP_S % 2.0
    x = 5.0 + 60.0 * np.where(cycle < 1.0, cycle, 2.0 - cycle)
    return Trial(
        info=TrialInfo(
            id="t",
            participant="P01",
            session=1,
            order=0,
            speed_mm_s=50.0,
            force_n=0.4,
            tones_hz=tuple(tone.hz for tone in excitation.tones),
            drive_vpp=150.0,
            sample_rate_hz=RATE_HZ,
            started_utc="2026-01-31T12:00:00+00:00",
        ),
        voltage_v=None,
        force_n=force,
        accel_m_s2=None,
        skin_velocity_m_s=None,
        position_mm=np.column_stack([x, np.full(x.size, 17.0)]),
        position_t_s=at_s,
    )


def test_each_sweep_is_a_stretch_of_friction_against_the_motion(
    rng: np.random.Generator,
) -> None:
    stretches = list(stretches_of(trial(rng)))
    assert len(stretches) == SWEEPS
    assert all(0.8 * SWEEP_S < part.size / RATE_HZ < SWEEP_S for part in stretches)
    assert all(part.mean() == pytest.approx(0.2, abs=0.02) for part in stretches)


def test_a_sweep_with_missing_samples_is_left_out(rng: np.random.Generator) -> None:
    assert len(list(stretches_of(trial(rng, lost=slice(30_000, 30_010))))) == SWEEPS - 1


def test_a_linear_finger_is_not_accused(rng: np.random.Generator) -> None:
    details, notes = linearity_of([trial(rng), trial(rng)])
    assert notes == ()
    assert details["even"]["level"] < 0.01
    assert details["odd"]["level"] < 0.01


@pytest.mark.parametrize(("square", "cube", "parity"), [(0.3, 0.0, "even"), (0.0, 1.0, "odd")])
def test_what_is_not_linear_is_named(
    rng: np.random.Generator, square: float, cube: float, parity: str
) -> None:
    details, notes = linearity_of([trial(rng, square, cube), trial(rng, square, cube)])
    (note,) = notes
    assert f"at {parity} lines" in note
    assert details[parity]["p_value"] < 1e-6


def test_short_sweeps_tell_nothing(rng: np.random.Generator) -> None:
    details, (note,) = linearity_of([trial(rng, lost=slice(None, None, 1_000))])
    assert details == {}
    assert "not judged" in note
    assert linearity_of([]) == ({}, ())
