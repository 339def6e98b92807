"""The compiled fits beside themselves as plain Python, over all that a trial may hold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.plain import compared, few

from frictus_service.identification.observation import blocks, least_squares, validity
from frictus_service.identification.observation.blocks import BLOCK
from frictus_service.identification.observation.tones import Tones, fit

pytestmark = pytest.mark.compiled

FEW = settings(max_examples=few(5))  # as plain Python takes long
RATE_HZ = 20_000.0
usual = st.floats(-1e3, 1e3)
sample = usual | st.sampled_from([np.nan, 0.0, 1e-300, 1e6, -1e6])


@FEW
@given(
    st.lists(st.floats(20.0, 3e3), min_size=1, max_size=3, unique_by=lambda hz: round(hz / 50)),
    st.integers(0, 2**32 - 1),
    st.lists(st.tuples(st.integers(0, 10_000), sample), max_size=30),
    st.integers(0, 20),
)
def test_what_is_fitted(
    tones_hz: list[float], seed: int, replaced: list[tuple[int, float]], more: int
) -> None:
    tones = Tones(tuple(sorted(tones_hz)), RATE_HZ)
    count = int(np.ceil(tones.least_s * RATE_HZ / BLOCK)) + more
    samples = np.random.default_rng(seed).standard_normal((count * BLOCK, 2))
    for place, value in replaced:
        samples[place % len(samples), place % 2] = value
    with compared(blocks, least_squares) as watched:
        found = fit(tones, tones.reduce([samples]), [(1.0, 0.5)], 0, count)
    assert found.amplitude.shape == (1, len(tones_hz))
    assert watched["solve"].calls == 1
    assert watched["_sum"].calls


@given(st.lists(sample, min_size=1, max_size=50))
def test_what_is_clipped(samples: list[float]) -> None:
    with compared(validity) as watched:
        validity.inspect(np.array(samples)[:, np.newaxis])
    assert watched["_ends"].calls == 1
