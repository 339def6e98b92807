"""Fixtures that every test may use."""

import gc
import os
import secrets
import signal
import sys
import zlib
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

# Many tests start processes, each of which imports numba and scipy. Compiled anew every time,
# as where a container's environment keeps no bytecode, this takes longer than what they test.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

settings.register_profile(
    "frictus",
    deadline=None,  # the machine may be busy
    derandomize=True,  # a test that passed once passes again; campaigns draw anew
)
settings.register_profile("campaign", deadline=None, database=None, max_examples=300)
settings.load_profile("frictus")


def pytest_collection_finish() -> None:
    """Leave the thousands of tests themselves out of every collection of garbage."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def nothing_frozen() -> Iterator[None]:
    """Of a test that asks what is: the tests themselves are, else."""
    gc.unfreeze()
    yield
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def single_threaded() -> Iterator[None]:
    """Matrices are small here: threads wait for each other longer than they work."""
    with threadpool_limits(limits=1):
        yield


def _seed_of(node: pytest.Item | pytest.Collector) -> int:
    """Return the seed of a test or a module: of its node id, fresh in a campaign.

    It is printed when the test fails.
    """
    campaign = node.get_closest_marker("campaign") or node.get_closest_marker("blind")
    seed = secrets.randbits(31) if campaign else zlib.crc32(node.nodeid.encode()) >> 1
    print(f"seed of {node.nodeid}: {seed}")  # noqa: T201 - shown by pytest on failure
    return seed


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    """The test's own seed, 31 bits."""
    return _seed_of(request.node)


@pytest.fixture(scope="module")
def module_seed(request: pytest.FixtureRequest) -> int:
    """The seed of what a module's tests share, 31 bits."""
    return _seed_of(request.node)


@pytest.fixture
def rng(seed: int) -> np.random.Generator:
    """A generator with the test's own seed."""
    return np.random.default_rng(seed)


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Child processes hear Ctrl-C, even where a shell runs these tests in its background.

    Such a shell has them ignore SIGINT, and what is ignored stays so in every child.
    """
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, former)
