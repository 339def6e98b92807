"""`frictus mount --out` writes what `--mount` reads."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.study.trial import read_mount

RATE_HZ, NATURAL_HZ, DAMPING = 20_000.0, 1500.0, 0.03


def test_the_strongest_resonance_with_a_gain_of_one(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    time_s = np.arange(round(0.3 * RATE_HZ)) / RATE_HZ
    turned = 2.0 * np.pi * NATURAL_HZ * (1j * np.sqrt(1.0 - DAMPING**2) - DAMPING)
    blow = np.exp(turned * time_s).imag
    samples = np.tile(blow, 6) + 1e-4 * rng.standard_normal(6 * blow.size)
    np.save(tmp_path / "blows.npy", samples)
    out = tmp_path / "mount.json"
    words = ["mount", str(tmp_path / "blows.npy"), "--rate", str(RATE_HZ), "--out", str(out)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.stderr
    assert "its gain at rest is 1" in result.stderr
    lateral = read_mount(out)
    assert lateral is not None
    (at_rest, at_peak) = np.abs(lateral.frequency_response(np.array([0.0, NATURAL_HZ])))
    assert at_rest == pytest.approx(1.0)
    assert at_peak == pytest.approx(1.0 / (2.0 * DAMPING), rel=0.05)
