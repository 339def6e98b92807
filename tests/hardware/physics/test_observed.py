"""A recorded trial of a finger with many effects, through the estimator of the service."""

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.screen import Screen, screen_voltage
from frictus_hardware.physics.simulator import Probe, Simulator, predict
from frictus_hardware.physics.twin import Signals, simulate
from frictus_hardware.simulated.motion import Press
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import ResponseRows
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

RATE_HZ = 20_000.0
MINUTES = 14.0
TONES_HZ = (67.0, 239.0, 613.0, 1187.0)
MIXTURE = [
    ("speed_dependent_cutoff", {"slope_hz_per_mm_s": -5.0}),
    ("force_dependent_cutoff", {"exponent": 0.18}),
    ("cutoff_drift", {"per_minute": -0.02}),
    ("speed_dependent_gain", {"exponent": -0.25}),
    ("force_dependent_gain", {"exponent": 0.18}),
    ("gain_drift", {"per_minute": 0.02}),
    ("direction_asymmetry", {"share": 0.06}),
    ("position_dependent_gain", {"per_mm": -0.005}),
    ("charge_leakage", {"corner_hz": 1.0}),
    ("channel_delay", {"delay_s": 4e-6}),
    ("mount_resonance_shift", {"share": 0.0048}),
    ("fractional_rolloff", {"excess_order": 0.12}),
    ("residual_quadratic", {"share": 0.0048}),
    ("amplitude_compression", {"share": -0.0048}),
]


def recorded(simulator: Simulator, rng: np.random.Generator) -> Trial:
    time_s = np.arange(round(2.5 * RATE_HZ)) / RATE_HZ
    press = Press(target_n=0.5, wander_n=0.02)
    strokes = SteadyStrokes(speed_mm_s=45.0, span_mm=50.0, press=press)
    motion = strokes.start((70.0, 35.0), rng).at(time_s)
    phase = rng.uniform(0.0, 2.0 * np.pi, len(TONES_HZ))
    waves = np.cos(2.0 * np.pi * np.multiply.outer(time_s, np.array(TONES_HZ)) + phase)
    volts = screen_voltage(Screen(), 0.5 + 0.499 * waves.mean(axis=1), 0, RATE_HZ)
    signals = Signals.driven(
        RATE_HZ,
        volts,
        motion.position_mm,
        motion.velocity_mm_s,
        motion.normal_force_n,
        motion.in_contact,
    )
    felt = simulate(simulator.twin(Screen(), 0.5, minutes=MINUTES), signals)
    scans = np.arange(0.0, time_s.size, RATE_HZ / 60.0).astype(int)
    return Trial(
        info=TrialInfo(
            "t0", "P01", 0, 0, 45.0, 0.5, TONES_HZ, 150.0, RATE_HZ, "2026-01-05T09:00:00Z"
        ),
        voltage_v=volts,
        force_n=felt.force_n,
        accel_m_s2=felt.accel_m_s2,
        skin_velocity_m_s=None,
        position_mm=motion.position_mm[scans],
        position_t_s=scans / RATE_HZ,
    )


def probe_of(rows: ResponseRows) -> Probe:
    ones = np.ones(rows.tone_hz.size)
    tones = len(TONES_HZ)
    power = np.square(np.abs(rows.message)).reshape(-1, tones).sum(axis=1) / 2.0
    return Probe(
        rows.tone_hz,
        rows.message,
        0.5 * ones,
        np.repeat(power, tones),
        SlidingConditions(
            rows.speed_mm_s,
            rows.normal_force_n,
            rows.position_mm,
            rows.direction.astype(float),
            MINUTES * ones,
        ),
    )


def off(found: NDArray[np.complex128], expected: NDArray[np.complex128]) -> tuple[float, float]:
    """Size in per cent and phase in degrees, of three quarters of all rows."""
    ratio = found / expected
    sizes, turns = np.abs(np.abs(ratio) - 1.0), np.abs(np.angle(ratio, deg=True))
    return 100.0 * float(np.quantile(sizes, 0.75)), float(np.quantile(turns, 0.75))


def test_the_estimator_reports_what_is_predicted(rng: np.random.Generator) -> None:
    base = Simulator()
    simulator = extended(base, MIXTURE)
    nominal = base.mount
    rows = observe(recorded(simulator, rng), StudyInfo("twin", mount=nominal)).rows
    predicted = predict(simulator, probe_of(rows), nominal).friction
    size, turn = off(rows.friction_response, predicted)
    assert size <= 0.3
    assert turn <= 0.2
    without = predict(base, probe_of(rows), nominal).friction
    assert off(rows.friction_response, without)[0] > 10.0


def test_a_band_is_predicted_as_its_mean_over_frequency() -> None:
    """As the mean of many tones of the same centroid and variance, delay and fall included."""
    simulator = extended(Simulator(), [("channel_delay", {"delay_s": 2e-4})])
    off_hz = np.linspace(-1.0, 1.0, 201)
    one = np.ones(1)

    def seen(at_hz: FloatArray, spread_hz: FloatArray | float) -> NDArray[np.complex128]:
        ones = np.ones(at_hz.size)
        around = SlidingConditions(60.0 * ones, 0.4 * ones, 35.0 * ones, ones, 0.0 * ones)
        nothing = np.zeros(at_hz.size)
        probe = Probe(at_hz, nothing.astype(complex), nothing, nothing, around, spread_hz)
        return predict(simulator, probe, simulator.mount).friction

    for centre_hz in (60.0, 400.0, 1200.0):
        half_hz = 0.058 * centre_hz
        mean = seen(centre_hz + half_hz * off_hz, 0.0).mean()
        (band,) = seen(centre_hz * one, half_hz * off_hz.std() * one)
        (middle,) = seen(centre_hz * one, 0.0)
        assert abs(band / mean - 1.0) < 1e-4
        assert abs(band - mean) < 0.05 * abs(middle - mean)


def test_a_band_on_the_flank_of_a_resonance_is_predicted_as_its_mean() -> None:
    """Where power falls over the band it has a skewness: a mount that moved shows beside it."""
    base = Simulator()
    moved = extended(base, [("mount_resonance_shift", {"share": 0.0133})])
    assert base.mount is not None
    hz = np.linspace(1690.0, 1890.0, 401)
    power = np.square(np.abs(base.mount.frequency_response(hz)))
    power /= power.sum()
    centroid_hz = power @ hz
    off_hz = hz - centroid_hz
    spread_hz = np.sqrt(power @ np.square(off_hz))
    skewness = power @ np.power(off_hz, 3) / spread_hz**3
    assert skewness > 0.4

    def seen(at_hz: FloatArray, **of_band: FloatArray) -> NDArray[np.complex128]:
        ones = np.ones(at_hz.size)
        around = SlidingConditions(60.0 * ones, 0.4 * ones, 35.0 * ones, ones, 0.0 * ones)
        nothing = np.zeros(at_hz.size)
        probe = Probe(at_hz, nothing.astype(complex), nothing, nothing, around, **of_band)
        return predict(moved, probe, base.mount).friction

    mean = power @ seen(hz)
    spread = {"spread_hz": np.array([spread_hz])}
    (even,) = seen(np.array([centroid_hz]), **spread)
    (band,) = seen(np.array([centroid_hz]), **spread, skewness=np.array([skewness]))
    assert abs(even / mean - 1.0) > 3e-3
    assert abs(band / mean - 1.0) < 5e-4


def test_a_band_is_predicted_as_its_mean_over_speed() -> None:
    """A finger that speeds up while noise is played has no cutoff of its mean speed."""
    simulator = Simulator()
    speeds_mm_s = 60.0 + 12.0 * np.linspace(-1.0, 1.0, 201)

    def seen(speed_mm_s: FloatArray, **of_band: FloatArray) -> NDArray[np.complex128]:
        ones = np.ones(speed_mm_s.size)
        around = SlidingConditions(speed_mm_s, 0.4 * ones, 35.0 * ones, ones, 0.0 * ones)
        nothing = 0.0 * ones
        at_hz = 700.0 * ones
        probe = Probe(at_hz, nothing.astype(complex), nothing, nothing, around, **of_band)
        return predict(simulator, probe, simulator.mount).friction

    mean, narrow = seen(speeds_mm_s).mean(), {"spread_hz": np.ones(1)}
    (steady,) = seen(np.array([60.0]), **narrow)
    spread = {"speed_spread_mm_s": np.array([speeds_mm_s.std()])}
    (band,) = seen(np.array([60.0]), **narrow, **spread)
    assert abs(steady / mean - 1.0) > 1e-3
    assert abs(band - mean) < 0.05 * abs(steady - mean)
