"""Device samples by the host's clock, from blocks that come late at random."""

import numpy as np
import pytest

from frictus_hardware.sensors.timing import LARGEST_SKEW, Alignment, aligned

RATE_HZ = 20_000.0
BLOCK = 100


@pytest.mark.parametrize("skew", [-1e-4, 0.0, 1e-4])
def test_late_blocks_do_not_shift_it(rng: np.random.Generator, skew: float) -> None:
    """Late by 10 ms now and then, by 0.2 ms mostly: what is found is off by the least."""
    began_s = float(rng.uniform(0.0, 1e6))
    found: Alignment | None = None
    for number in range(1, 4_000):
        end = number * BLOCK
        taken_s = began_s + end / (RATE_HZ * (1.0 + skew))
        late_s = float(rng.exponential(2e-4) + 1e-2 * (rng.random() < 0.1))
        found = aligned(found, end, taken_s + late_s, RATE_HZ)
        if number > 400:  # 2 s
            off = found.sample_at(taken_s) - end
            assert -1e-3 * RATE_HZ < off < 1.0 + 4.0 * LARGEST_SKEW * RATE_HZ


def test_what_was_found_first_stands_for_itself() -> None:
    found = aligned(None, 500, 3.0, RATE_HZ)
    assert found.sample_at(3.0) == 500.0
    assert found.sample_at(2.99) == pytest.approx(300.0)
