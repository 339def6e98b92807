"""Intervals of a mount hold from recording to recording: coverage, limits, real blows."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.io import loadmat
from tests.service.discovery.mount.test_ring_down import BAND_HZ, RATE_HZ, REAL, blows
from typer.testing import CliRunner

from frictus_hardware.arrays import FloatArray
from frictus_service.cli.app import app
from frictus_service.discovery.between_recordings import between, between_recordings
from frictus_service.discovery.ring_down import RingDownError, estimate_ring_down


def recording(rng: np.random.Generator, shift: float, *modes: float) -> FloatArray:
    placed = [(hz * (1.0 + shift), 0.02, 1.0) for hz in modes or (1600.0,)]
    return blows(placed, 1e-4, rng, 5)


def test_without_errors_of_their_own_it_is_the_t_interval(rng: np.random.Generator) -> None:
    values = rng.normal(1600.0, 5.0, 6)
    found = between(values, np.zeros(6))
    error = stats.sem(values)
    assert found.sd == pytest.approx(values.std(ddof=1), rel=1e-3)
    np.testing.assert_allclose(
        found.ci, stats.t.interval(0.95, 5, values.mean(), error), rtol=1e-6
    )
    wide = stats.t.interval(
        0.95, 5, values.mean(), values.std(ddof=1) * np.sqrt(1.0 + 1.0 / 6.0)
    )
    np.testing.assert_allclose(found.another, wide, rtol=1e-5)


def test_recordings_that_agree_are_as_sure_as_their_errors_allow() -> None:
    found = between(np.full(4, 1600.0), np.full(4, 2.0))
    assert found.sd == 0.0
    assert found.standard_error == pytest.approx(2.0 / np.sqrt(4.0))
    assert between(np.full(3, 1600.0), np.zeros(3)).ci == (1600.0, 1600.0)


@pytest.mark.parametrize("share", [0.002, 0.005])
@pytest.mark.parametrize("count", [2, 3, 6])
def test_coverage(share: float, count: int, rng: np.random.Generator) -> None:
    """Each recording's own errors differ eightfold; 0.2 and 0.5 % between recordings."""
    runs, held, next_held, alone = 1500, 0, 0, 0
    for _ in range(runs):
        errors = rng.uniform(0.25, 2.0, count + 1)
        truths = 1600.0 * (1.0 + share * rng.standard_normal(count + 1))
        values = truths + errors * rng.standard_normal(count + 1)
        found = between(values[:-1], errors[:-1])
        held += found.ci[0] < 1600.0 < found.ci[1]
        next_held += found.another[0] < values[-1] < found.another[1]
        alone += abs(values[0] - 1600.0) < 1.96 * errors[0]
    # 95 % with three standard errors of 1500 runs; two recordings hold more where their own
    # errors are what tells them apart. One recording's own interval does not hold.
    most = 1.0 if count == 2 else 0.985
    assert 0.93 < held / runs <= most
    assert 0.93 < next_held / runs <= most
    assert alone / runs < 0.7


def test_blows_of_recordings_that_differ(rng: np.random.Generator) -> None:
    held = 0
    for _ in range(8):
        shifts = 0.004 * rng.standard_normal(3)
        each = [estimate_ring_down(recording(rng, shift), RATE_HZ, BAND_HZ) for shift in shifts]
        (found,) = between_recordings(each)
        held += found.frequency_ci_hz[0] < 1600.0 < found.frequency_ci_hz[1]
        assert found.another_frequency_hz is not None
        low_hz, high_hz = found.another_frequency_hz
        assert low_hz < found.frequency_ci_hz[0] < found.frequency_ci_hz[1] < high_hz
        assert 0.0 < found.damping_ratio_ci[0] < 0.02 < 1.1 * found.damping_ratio_ci[1]
    assert held >= 6


def test_a_resonance_is_given_where_all_recordings_have_it(rng: np.random.Generator) -> None:
    both, one, other = (
        estimate_ring_down(recording(rng, 0.0, *modes), RATE_HZ, BAND_HZ)
        for modes in ((1600.0, 3000.0), (1600.0,), (4200.0,))
    )
    (shared,) = between_recordings([both, one])
    assert shared.frequency_hz == pytest.approx(1600.0, rel=1e-3)
    assert between_recordings([one, both])[0].frequency_hz == pytest.approx(shared.frequency_hz)
    with pytest.raises(RingDownError, match="in all 2 recordings within 3%"):
        between_recordings([one, other])
    with pytest.raises(RingDownError, match="1 recordings; accepted: 2"):
        between_recordings([one])


def test_the_command_says_for_what_intervals_hold(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    paths = [tmp_path / f"{k}.npy" for k in range(3)]
    for path, shift in zip(paths, (-0.004, 0.0, 0.003), strict=True):
        np.save(path, recording(rng, shift))
    words = ["mount", "--rate", str(RATE_HZ), "--json"]
    run = CliRunner().invoke
    alone = run(app, [*words, str(paths[0])])
    assert "the intervals hold within this recording" in alone.stderr
    (one,) = json.loads(alone.stdout)["resonances"]
    assert one["another_frequency_hz"] is None
    together = run(app, [*words, *map(str, paths)])
    assert "1 resonance is in all 3 recordings" in together.stderr
    (all_,) = json.loads(together.stdout)["resonances"]
    assert np.ptp(all_["frequency_ci_hz"]) > 3.0 * np.ptp(one["frequency_ci_hz"])
    shown = run(app, ["mount", "--rate", str(RATE_HZ), *map(str, paths)])
    assert shown.exit_code == 0, shown.stderr
    assert run(app, [*words, str(paths[0]), str(paths[0])]).exit_code == 2


@pytest.mark.skipif(not REAL.exists(), reason="the blows are not at ../shared/data")
def test_real_blows_in_any_band_and_any_part_agree() -> None:
    """Bands once gave 1626.9 [1626.3, 1627.5] and 1636.8 [1636.0, 1637.6] of one recording."""
    held = loadmat(REAL)
    samples, rate_hz = held["out"].ravel(), float(held["sr"].item())
    spans = []
    for band_hz in ((1000.0, 6000.0), (1000.0, 3000.0), (1300.0, 2500.0), (800.0, 4000.0)):
        found = estimate_ring_down(samples, rate_hz, band_hz)
        (broad,) = [
            each
            for each in found
            if 1610.0 < each.frequency_hz < 1650.0 and each.damping_ratio > 0.03
        ]
        spans.append(broad.frequency_ci_hz)
    assert max(low for low, _ in spans) < min(high for _, high in spans)
