"""The amplitudes of lines, whatever the length."""

import numpy as np
import pytest

from frictus_service.identification.observation.hann_spectrum import LONGEST, hann_spectrum


@pytest.mark.parametrize("size", [1, 7, 29_984, 32_768, 100_003])
def test_a_line_has_its_amplitude_at_its_place(size: int, rng: np.random.Generator) -> None:
    constant, amplitude = rng.uniform(1.0, 3.0, 2)
    _, length = hann_spectrum(np.zeros(size))
    assert 0.8 * min(size, LONGEST) < length <= min(size, LONGEST)
    line = length // 5
    tone = amplitude * np.cos(2.0 * np.pi * line / length * np.arange(size))
    samples = np.column_stack([constant + tone, np.full(size, constant)])
    amplitudes, again = hann_spectrum(samples)
    assert (amplitudes.shape, again) == ((length // 2 + 1, 2), length)
    np.testing.assert_allclose(amplitudes[:, 1], 0.0, atol=1e-9)
    if line > 2:
        assert np.argmax(amplitudes[:, 0]) == line
        assert amplitudes[line, 0] == pytest.approx(amplitude, rel=1e-3)


def test_what_is_missing_counts_as_nothing() -> None:
    samples = np.array([0.0, 1.0, np.nan, -1.0] * 100)
    assert np.isfinite(hann_spectrum(samples)[0]).all()
