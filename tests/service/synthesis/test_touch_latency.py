"""From a touch report to a changed output, in samples of a real device's clock."""

import numpy as np
import pytest
from tests.hardware.nidaq.latency import configured, latencies


@pytest.mark.parametrize(("block_ms", "lead_ms"), [(1.0, 15.0), (2.0, 15.0), (5.0, 30.0)])
def test_a_report_changes_the_output_one_lead_after_the_block_in_which_it_came(
    rng: np.random.Generator, block_ms: float, lead_ms: float
) -> None:
    config = configured(block_ms, lead_ms)
    for found in latencies(config, rng, n_reports=2):
        # The sample at which the block begins may be the same in both: it fades over.
        least = config.lead_samples + 1
        assert least <= found <= config.lead_samples + config.block_samples + 2
