"""Mobility and mount against what the paper's appendix implies, and their simulation."""

import math
import subprocess
import sys

import numpy as np
import pytest

from frictus_hardware.physics import linear
from frictus_hardware.physics.linear import (
    Mobility,
    Mount,
    TransferFunction,
    with_moved_resonance,
)

BAND_HZ = np.geomspace(30.0, 2000.0, 15)


def test_mobility_peaks_at_its_natural_frequency_with_one_over_b() -> None:
    finger = Mobility()
    natural_hz = math.sqrt(finger.stiffness_n_m / finger.mass_kg) / (2.0 * math.pi)
    response = finger.velocity.frequency_response(np.array([natural_hz]))
    np.testing.assert_allclose(response, 1.0 / finger.damping_n_s_m, rtol=1e-12)


def test_mobility_is_spring_below_and_mass_above() -> None:
    finger = Mobility()
    low, high = finger.velocity.frequency_response(np.array([0.01, 1e5]))
    assert low == pytest.approx(2j * math.pi * 0.01 / finger.stiffness_n_m, rel=1e-3)
    assert high == pytest.approx(1.0 / (2j * math.pi * 1e5 * finger.mass_kg), rel=2e-3)
    acceleration = finger.acceleration.frequency_response(BAND_HZ)
    velocity = finger.velocity.frequency_response(BAND_HZ)
    np.testing.assert_allclose(acceleration, 2j * np.pi * BAND_HZ * velocity, rtol=1e-12)


def test_mount_gain_at_rest_is_1_160() -> None:
    response = Mount().lateral.frequency_response(np.array([1e-6]))
    assert abs(response[0]) == pytest.approx((922.0 / 856.0) ** 2, rel=1e-9)
    assert abs(response[0]) == pytest.approx(1.160, abs=5e-4)
    assert abs(Mount().normal.frequency_response(np.array([1e-6]))[0]) == pytest.approx(1.0)


def test_mount_without_the_papers_extra_s() -> None:
    mount = Mount().lateral
    with_s = mount * TransferFunction((1.0, 0.0), (1.0,))
    extra_db = 20.0 * np.log10(
        np.abs(
            with_s.frequency_response(BAND_HZ[[0, -1]])
            / mount.frequency_response(BAND_HZ[[0, -1]])
        )
    )
    np.testing.assert_allclose(extra_db, [45.5, 82.0], atol=0.05)
    # A ratio of forces is near 1 where nothing resonates; with the extra s it would not be.
    assert abs(mount.frequency_response(np.array([30.0]))[0]) == pytest.approx(1.16, rel=2e-3)


def test_mount_rings_for_milliseconds_not_for_hours() -> None:
    slowest = -max(root.real for root in np.roots(Mount().lateral.denominator))
    assert 1.0 / slowest == pytest.approx(2.0 / 92.0, rel=1e-6)
    # As printed, the tape's pair alone (s^2 + 1e-4 s + w^2) would take 20,000 s.
    pole = np.roots([1.0, 1e-4, (2.0 * math.pi * 856.0) ** 2])[0]
    assert -1.0 / pole.real == pytest.approx(20_000.0, rel=1e-3)


def test_mount_resonates_where_it_was_measured() -> None:
    frequency_hz = np.arange(700.0, 2100.0, 0.5)
    size = np.abs(Mount().lateral.frequency_response(frequency_hz))
    peaks = frequency_hz[1:-1][(size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])]
    np.testing.assert_allclose(peaks, [866.0, 1740.0], rtol=0.02)  # as read off in the paper


@pytest.mark.parametrize(
    "transfer", [Mount().lateral, Mount().normal, Mobility().acceleration, Mobility().velocity]
)
def test_first_order_hold_is_exact_for_straight_input(transfer: TransferFunction) -> None:
    # A ramp is straight between samples, so the samples are those of the continuous response.
    rate = 20_000.0
    sampled = linear.sample(transfer, rate)
    time_s = np.arange(400) / rate
    out, _ = sampled.run(time_s[:, np.newaxis], sampled.at_rest(1))
    # The answer to a ramp: partial fractions of G(s) / s^2.
    numerator = np.asarray(transfer.numerator)
    denominator = np.asarray(transfer.denominator)
    poles = np.roots(denominator)
    slope = np.polyder(denominator)
    residues = np.polyval(numerator, poles) / (np.polyval(slope, poles) * poles**2)
    at_rest = numerator[-1] / denominator[-1]
    n1 = numerator[-2] if numerator.size > 1 else 0.0
    first = (n1 * denominator[-1] - numerator[-1] * denominator[-2]) / denominator[-1] ** 2
    analytic = at_rest * time_s + first + np.real(np.exp(np.outer(time_s, poles)) @ residues)
    scale = np.max(np.abs(analytic))
    np.testing.assert_allclose(out[:, 0], analytic, atol=1e-9 * scale)


def test_sampling_loads_no_half_of_scipy() -> None:
    # Every rig samples at its start; `scipy.signal` alone took a third of that.
    program = (
        "import sys\n"
        "from frictus_hardware.physics import linear\n"
        "linear.sample(linear.Mount().lateral, 20_000.0)\n"
        "print(*({'scipy.signal', 'scipy.stats', 'scipy.optimize'} & sys.modules.keys()))"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    assert loaded.stdout.split() == []


def test_state_carries_over_any_split(rng: np.random.Generator) -> None:
    sampled = linear.sample(Mount().lateral, 80_000.0)
    noise = rng.standard_normal((500, 2))
    whole, _ = sampled.run(noise, sampled.at_rest(2))
    state = sampled.at_rest(2)
    parts = []
    for part in np.split(noise, np.sort(rng.integers(1, 500, 7))):
        if part.size:
            out, state = sampled.run(part, state)
            parts.append(out)
    np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize(
    "transfer",
    [
        TransferFunction((1.0, 0.0, 0.0), (1.0, 1.0)),
        TransferFunction((1.0,), (1.0, 0.0)),
    ],
)
def test_what_cannot_be_sampled_is_refused(transfer: TransferFunction) -> None:
    with pytest.raises(ValueError, match="proper"):
        linear.sample(transfer, 20_000.0)


@pytest.mark.parametrize("share", [-0.3, -0.0467, 0.0048, 0.2])
def test_a_moved_resonance_keeps_damping_ratio_gain_at_rest_and_the_other_pair(
    share: float,
) -> None:
    nominal = Mount().lateral
    moved = with_moved_resonance(nominal, share)

    def resonances(mount: TransferFunction) -> list[complex]:
        poles = np.roots(mount.denominator)
        return sorted(poles[poles.imag > 0.0], key=abs)

    tape, sensor = resonances(nominal)
    tape_now, sensor_now = sorted(resonances(moved), key=lambda pole: abs(pole - tape))
    assert tape_now == pytest.approx(tape, rel=1e-9)
    assert sensor_now == pytest.approx((1.0 + share) * sensor, rel=1e-9)
    low_hz = np.array([1e-3])
    np.testing.assert_allclose(
        moved.frequency_response(low_hz), nominal.frequency_response(low_hz), rtol=1e-6
    )
    zeros, zeros_now = np.roots(nominal.numerator), np.roots(moved.numerator)
    np.testing.assert_allclose(zeros_now, zeros, rtol=1e-9)


def test_without_a_resonance_nothing_moves() -> None:
    stiff = TransferFunction((1.0,), (1e-4, 1.0))
    assert with_moved_resonance(stiff, 0.1) == stiff
