"""Beside processes that compute without pause, readers lose nothing and the loop keeps time."""

import json
import sys

import pytest

from frictus_laboratory.benchmarks.lateness import measure_beside


@pytest.mark.load
@pytest.mark.timeout(240.0)
@pytest.mark.parametrize("busy", [1, 2])
def test_beside_busy_processes(busy: int, capsys: pytest.CaptureFixture[str]) -> None:
    loss, lateness = measure_beside(busy, seconds=10.0)
    with capsys.disabled():
        for figure in (loss, lateness):
            sys.stdout.write(json.dumps(figure.fields()) + "\n")
    assert loss.value["received"] > 0.9 * 10.0 * 200.0 * 4 * 16
    assert loss.met, "subscribers that read lost blocks"
    assert (
        loss.beside["handed_over"] + loss.beside["on_the_way"] + loss.beside["by_the_reader"]
        >= loss.value["lost"]
    ), "a loss that no queue accounts for"
    assert lateness.met, "the loop was late"
