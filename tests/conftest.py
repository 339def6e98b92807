"""Fixtures that every test may use."""

import secrets
import signal
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

settings.register_profile("frictus", deadline=None)  # the machine may be busy
settings.load_profile("frictus")


@pytest.fixture(scope="session", autouse=True)
def single_threaded() -> Iterator[None]:
    """Matrices are small here: threads wait for each other longer than they work."""
    with threadpool_limits(limits=1):
        yield


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """A generator with a fresh seed, printed when the test fails."""
    seed = secrets.randbits(32)
    request.node.add_report_section("setup", "seed", f"np.random.default_rng({seed})")
    print(f"seed: np.random.default_rng({seed})")  # noqa: T201 - shown by pytest on failure
    return np.random.default_rng(seed)


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Child processes hear Ctrl-C, even where a shell runs these tests in its background.

    Such a shell has them ignore SIGINT, and what is ignored stays so in every child.
    """
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, former)
