"""Fixtures that every test may use."""

import secrets
from collections.abc import Iterator

import numpy as np
import pytest


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> Iterator[np.random.Generator]:
    """A generator with a fresh seed, printed when the test fails."""
    seed = secrets.randbits(32)
    request.node.add_report_section("setup", "seed", f"np.random.default_rng({seed})")
    print(f"seed: np.random.default_rng({seed})")  # noqa: T201 - shown by pytest on failure
    yield np.random.default_rng(seed)
