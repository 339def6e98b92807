"""What the benchmark of the start takes from a service that starts, or does not."""

import os
from pathlib import Path

import pytest

from frictus_laboratory.benchmarks.start import _figure, _Start, step_of
from frictus_service.errors import StartError


@pytest.mark.parametrize(
    ("line", "step"),
    [
        ("rig, 0.3 s: loading\n", "loading"),
        ("rig, 12.0 s: opening the device (simulated)\n", "opening the device"),
        ("rig, 3.7 s: compiling _sum_rows\n", None),
        ("api, 0.3 s: loading\n", None),
        ("rig: loop priority: real time (SCHED_FIFO 20)\n", None),
    ],
)
def test_the_steps_of_the_rig_are_taken_from_what_is_said(line: str, step: str | None) -> None:
    assert step_of(line) == step


def test_a_service_that_does_not_start_is_told_with_its_reason(tmp_path: Path) -> None:
    (tmp_path / "frictus.toml").write_text("block_ms = 0.1\n")
    start = _Start(tmp_path, dict(os.environ))
    with pytest.raises(StartError, match=r"frictus\.toml:1: block_ms"):
        start.await_block()


def test_the_bound_is_of_the_first_block() -> None:
    assert _figure("start_warm", {"loading": 0.9, "first block": 2.9}, 3.0, "").met
    assert not _figure("start_warm", {"loading": 0.9, "first block": 3.1}, 3.0, "").met
