"""The twin against the analytic response of its parts."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics import friction
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mobility, Mount
from frictus_hardware.physics.screen import Screen, drive_fraction_of, screen_voltage
from frictus_hardware.physics.stages import (
    Contact,
    Decimate,
    FrictionResponse,
    Quantisation,
    SensorNoise,
    standard_twin,
)
from frictus_hardware.physics.twin import Signals, Twin, simulate

pytestmark = pytest.mark.compiled

RATE = 20_000.0


def sliding(drive: FloatArray, vx_mm_s: FloatArray | float) -> Signals:
    velocity = np.zeros((drive.size, 2))
    velocity[:, 0] = vx_mm_s
    return Signals.driven(
        RATE,
        screen_voltage(Screen(), drive, 0, RATE),
        np.cumsum(velocity, axis=0) / RATE,
        velocity,
        np.full(drive.size, 0.4),
        np.ones(drive.size, dtype=np.bool_),
    )


def fitted(signal: FloatArray, frequency_hz: float, first: int) -> complex:
    """Complex amplitude at a tone from a sample on, over whole periods of 1 s."""
    turned = 2.0 * np.pi * frequency_hz * np.arange(first, signal.size) / RATE
    design = np.column_stack([np.cos(turned), np.sin(turned), np.ones(turned.size)])
    cosine, sine, _ = np.linalg.lstsq(design, signal[first:], rcond=None)[0]
    return complex(cosine, -sine)


def tone(frequency_hz: float, n_samples: int) -> FloatArray:
    turned = 2.0 * np.pi * frequency_hz * np.arange(float(n_samples)) / RATE
    return 0.5 + 0.4 * np.cos(turned)


def hold(frequency_hz: float) -> complex:
    """The DAC's hold: sinc, and half a sample of delay."""
    return complex(np.sinc(frequency_hz / RATE) * np.exp(-1j * np.pi * frequency_hz / RATE))


def folded(response: Callable[[FloatArray], ComplexArray], frequency_hz: float) -> complex:
    """Hold and response at a tone, with the images that sampling without a filter folds in."""
    images_hz = frequency_hz + RATE * np.arange(-500.0, 501.0)
    held = np.sinc(images_hz / RATE) * np.exp(-1j * np.pi * images_hz / RATE)
    return complex(np.sum(held * response(images_hz)))


@pytest.mark.parametrize("speed_mm_s", [20.0, 60.0, 100.0])
@pytest.mark.parametrize(
    ("frequency_hz", "tolerance"), [(30.0, 1e-3), (253.0, 1e-3), (997.0, 1e-3), (1994.0, 2e-3)]
)
def test_twin_follows_the_analytic_response(
    frequency_hz: float, tolerance: float, speed_mm_s: float
) -> None:
    def law(f: FloatArray) -> ComplexArray:
        return friction.frequency_response(FrictionLaw(), f, speed_mm_s)

    settle = 10_000
    out = simulate(standard_twin(), sliding(tone(frequency_hz, settle + 20_000), speed_mm_s))
    mount, skin = Mount().lateral, Mobility().acceleration
    for seen, expected in (
        (out.friction_n, folded(law, frequency_hz)),
        (
            out.force_n[:, 0],
            folded(lambda f: law(f) * mount.frequency_response(f), frequency_hz),
        ),
        (
            out.accel_m_s2[:, 0],
            folded(lambda f: -law(f) * skin.frequency_response(f), frequency_hz),
        ),
    ):
        error = abs(fitted(seen, frequency_hz, settle) / (0.4 * expected) - 1.0)
        assert error <= tolerance


def test_sampled_friction_is_the_recursion_that_the_inverse_undoes(
    rng: np.random.Generator,
) -> None:
    # y[n+1] = a y[n] + (1 - a) g m[n]: the twin's steps in between must not show.
    signals = sliding(rng.random(500), 60.0)
    out = simulate(standard_twin(), signals)
    drive = drive_fraction_of(Screen(), signals.voltage_v)
    recursion, _ = friction.respond(FrictionLaw(), drive, np.full(500, 60.0), RATE)
    np.testing.assert_allclose(out.friction_n, recursion, atol=1e-12)


def test_cutoffs_are_in_hertz() -> None:
    # Read as rad/s, the paper's cutoff at 20 mm/s would cost 8 dB at 250 Hz.
    right = friction.frequency_response(FrictionLaw(), np.array([250.0]), 20.0)[0]
    assert 20.0 * np.log10(abs(right) / 0.39) == pytest.approx(-0.58, abs=0.01)
    pole = friction.cutoff_hz(FrictionLaw(), 20.0)
    wrong = pole / (2j * np.pi * 250.0 + pole)
    assert 20.0 * np.log10(abs(wrong)) == pytest.approx(-8.2, abs=0.1)


def test_hold_looks_like_a_delay_of_about_27_us() -> None:
    # Seen from a sampled command, over the tactile band, beside a first-order pole.
    frequency_hz = np.linspace(30.0, 1000.0, 200)
    held = np.array([hold(f) for f in frequency_hz])
    delay_s = -np.angle(held) / (2.0 * np.pi * frequency_hz)
    np.testing.assert_allclose(delay_s, 25e-6, rtol=1e-9)
    signals = sliding(tone(400.0, 30_000), 60.0)
    out = simulate(standard_twin(), signals)
    law = friction.frequency_response(FrictionLaw(), np.array([400.0]), 60.0)[0]
    beyond = fitted(out.friction_n, 400.0, 10_000) / (0.4 * law)
    assert -np.angle(beyond) / (2.0 * np.pi * 400.0) == pytest.approx(25e-6, rel=0.1)


def test_step_is_the_exact_exponential() -> None:
    signals = sliding(np.full(200, 0.5), 60.0)
    signals = replace(signals, voltage_v=np.full(200, 75.0 / np.sqrt(2.0)))  # m = 1, no carrier
    out = simulate(standard_twin(), signals)
    pole = 2.0 * np.pi * friction.cutoff_hz(FrictionLaw(), 60.0)
    analytic = 0.39 * (1.0 - np.exp(-pole * np.arange(200) / RATE))
    np.testing.assert_allclose(out.friction_n, analytic, atol=1e-12)


def test_any_split_gives_the_same_output(rng: np.random.Generator) -> None:
    n_samples = 3_000
    speed = 80.0 * np.sin(2.0 * np.pi * 3.0 * np.arange(n_samples) / RATE)
    signals = sliding(rng.random(n_samples), speed)
    twin = standard_twin(sensors=(SensorNoise(0.002, 0.05, 7), Quantisation()))
    whole = simulate(twin, signals, n_samples)
    cuts = np.unique(rng.integers(1, n_samples, 20)).tolist()
    states = twin.initial()
    first = 0
    for end in [*cuts, n_samples]:
        block, states = twin.run(signals.rows(slice(first, end)), states)
        for name, array in block.arrays().items():
            np.testing.assert_array_equal(array, whole.arrays()[name][first:end], err_msg=name)
        first = end


def test_friction_opposes_motion_and_passes_smoothly_through_rest() -> None:
    speed = np.linspace(-30.0, 30.0, 6_001)
    steady = replace(
        sliding(np.zeros(speed.size), speed), voltage_v=np.full(speed.size, 50.0)
    )  # no carrier
    out = simulate(standard_twin(), steady)
    moving = np.abs(speed) > 2.0
    # The mount rings, so the sign is asserted on the force at the finger.
    at_finger = out.finger_force_n[:, 0]
    assert np.all(np.sign(at_finger[moving]) == -np.sign(speed[moving]))
    near = np.abs(speed) < 20.0  # once the drive's onset is over
    assert np.max(np.abs(np.diff(at_finger[near]))) < 0.02  # no jump of 0.6 N
    assert np.mean(out.force_n[speed > 5.0, 0]) > 0.0  # the sensor reports the opposite
    assert np.mean(out.force_n[speed < -5.0, 0]) < 0.0


def test_friction_fades_at_rest_and_off_the_screen() -> None:
    drive = np.full(400, 1.0)
    signals = replace(sliding(drive, 60.0), voltage_v=np.full(400, 75.0 / np.sqrt(2.0)))
    full = simulate(standard_twin(), signals).friction_n[-1]
    slow = replace(signals, velocity_mm_s=signals.velocity_mm_s / 60.0)  # 1 mm/s: half
    assert simulate(standard_twin(), slow).friction_n[-1] == pytest.approx(full / 2.0, rel=1e-2)
    still = replace(signals, velocity_mm_s=0.0 * signals.velocity_mm_s)
    assert simulate(standard_twin(), still).friction_n[-1] == 0.0
    off = replace(signals, in_contact=np.zeros(400, dtype=np.bool_))
    out = simulate(standard_twin(), off)
    assert not np.any(out.friction_n)
    assert not np.any(out.force_n)


def test_along_y_friction_opposes_motion_too() -> None:
    signals = sliding(np.zeros(4_000), 0.0)
    signals.velocity_mm_s[:, 1] = -40.0
    out = simulate(standard_twin(friction_coefficient=0.5), signals)
    assert out.finger_force_n[-1] == pytest.approx([0.0, 0.2, -0.4])
    assert out.force_n[-1] == pytest.approx([0.0, -0.2 * 1.160, 0.4], rel=1e-3)


@dataclass(frozen=True, slots=True)
class HalfGain:
    """An effect, as a stage."""

    def initial(self) -> None:
        return None

    def run(self, signals: Signals, state: None) -> tuple[Signals, None]:
        return replace(signals, friction_n=0.5 * signals.friction_n), None


def test_an_effect_is_one_more_stage_anywhere() -> None:
    twin = standard_twin()
    halved = twin.with_stage(HalfGain(), after=FrictionResponse)
    kinds = [type(stage) for stage in halved.stages]
    assert kinds[kinds.index(HalfGain) - 1 : kinds.index(HalfGain) + 2] == [
        FrictionResponse,
        HalfGain,
        Contact,
    ]
    signals = sliding(np.full(500, 0.5), 60.0)
    np.testing.assert_array_equal(
        simulate(halved, signals).friction_n, 0.5 * simulate(twin, signals).friction_n
    )
    with pytest.raises(ValueError, match="Quantisation"):
        twin.with_stage(HalfGain(), after=Quantisation)


def test_sensors_add_noise_of_the_stated_size_in_steps() -> None:
    quiet = sliding(np.zeros(20_000), 60.0)
    noise = SensorNoise(0.01, 0.5, 3)
    noisy, _ = noise.run(quiet, noise.initial())
    assert np.std(noisy.force_n) == pytest.approx(0.01, rel=0.02)
    assert np.std(noisy.accel_m_s2) == pytest.approx(0.5, rel=0.02)
    assert abs(np.corrcoef(noisy.force_n.ravel(), noisy.accel_m_s2.ravel())[0, 1]) < 0.02
    steps = Quantisation(0.001, 0.1)
    rounded, _ = steps.run(noisy, None)
    counts = rounded.force_n / 0.001
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    assert np.max(np.abs(rounded.accel_m_s2 - noisy.accel_m_s2)) <= 0.05 + 1e-9


def test_decimation_keeps_the_sample_instants() -> None:
    signals = sliding(np.zeros(50), 20.0)
    out = simulate(Twin(standard_twin().stages), signals)
    assert any(isinstance(stage, Decimate) for stage in standard_twin().stages)
    np.testing.assert_allclose(out.position_mm, signals.position_mm, atol=1e-12)
    assert out.sample_rate_hz == RATE
