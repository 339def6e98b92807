"""Benches of the fake device, closed after the test."""

from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial

import pytest
from tests.hardware.nidaq import bench


@pytest.fixture
def make_bench() -> Iterator[bench.BenchMaker]:
    """A maker of benches."""
    with ExitStack() as stack:
        yield partial(bench.make_bench, stack)
