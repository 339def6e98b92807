"""Extremes are exact, however the samples are cut into pieces."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frictus_service.api.dashboard.traces import Decimator, samples_per_column


@settings(deadline=None)  # the machine may be busy
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 4),
    st.integers(1, 40),
    st.lists(st.integers(0, 70), min_size=1, max_size=12),
)
def test_extremes_whatever_the_pieces(
    seed: int, channels: int, per_column: int, lengths: list[int]
) -> None:
    data = np.random.default_rng(seed).normal(size=(channels, sum(lengths))).astype(np.float32)
    decimator = Decimator(per_column)
    pieces = np.split(data, np.cumsum(lengths)[:-1], axis=1)
    found = np.concatenate([decimator.push(piece) for piece in pieces], axis=2)
    columns = data.shape[1] // per_column
    assert found.shape == (channels, 2, columns)
    assert decimator.pending == data.shape[1] - columns * per_column
    for column in range(columns):
        part = data[:, column * per_column : (column + 1) * per_column]
        np.testing.assert_array_equal(found[:, 0, column], part.min(axis=1))
        np.testing.assert_array_equal(found[:, 1, column], part.max(axis=1))


def test_what_is_kept_is_no_more_than_a_column(rng: np.random.Generator) -> None:
    decimator = Decimator(100)
    for _ in range(50):
        decimator.push(rng.normal(size=(3, int(rng.integers(0, 1_000)))).astype(np.float32))
        assert decimator.pending < 100


def test_a_column_of_millions_of_samples_is_not_kept(rng: np.random.Generator) -> None:
    # A page may ask for one: it would cost all others the time to copy it, again and again.
    decimator = Decimator(1 << 23)
    data = rng.normal(size=(3, 100_000)).astype(np.float32)
    tracemalloc.start()
    for _ in range(50):
        assert decimator.push(data).shape == (3, 2, 0)
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert decimator.pending == 5_000_000
    assert kept < data.nbytes


@settings(deadline=None)  # the machine may be busy
@given(st.floats(1e3, 2e5), st.floats(0.01, 600.0), st.integers(16, 8_192))
def test_columns_span_the_window(rate_hz: float, window_s: float, columns: int) -> None:
    width = samples_per_column(rate_hz, window_s, columns)
    assert width * columns >= rate_hz * window_s * (1 - 1e-12)  # no more columns than asked
    assert width == 1 or (width - 1) * columns < rate_hz * window_s


def test_a_column_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        Decimator(0)
