"""Fixtures that every test may use."""

import secrets

import numpy as np
import pytest


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """A generator with a fresh seed, printed when the test fails."""
    seed = secrets.randbits(32)
    request.node.add_report_section("setup", "seed", f"np.random.default_rng({seed})")
    print(f"seed: np.random.default_rng({seed})")  # noqa: T201 - shown by pytest on failure
    return np.random.default_rng(seed)
