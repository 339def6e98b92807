"""The whole campaign: `uv run pytest -n 0 -m blind`; it goes on where it was stopped.

Lines lie in the cache folder of pytest; `bench/blind.py` makes the table from them.
"""

from pathlib import Path

import pytest
from tests.blind.campaign import go_on, read, tasks
from tests.blind.judgement import LEAST_INTERVALS, rates

SCORES = "scores.jsonl"


@pytest.mark.blind
@pytest.mark.timeout(6 * 3600)
def test_hidden_effects_are_found_and_nothing_else(request: pytest.FixtureRequest) -> None:
    cache = request.config.cache
    assert cache is not None
    scores: Path = cache.mkdir("blind") / SCORES
    wanted = tasks()
    for line in go_on(scores, wanted):
        print(line["name"], line["seed"], line.get("error", "scored"))  # noqa: T201
    names = {task.name for task in wanted}
    lines = [line for line in read(scores) if line["name"] in names]
    assert {line["name"] for line in lines} == names
    measured = rates(lines)
    broken = [f"{rate.what}: {rate.hits} of {rate.of}" for rate in measured if not rate.kept]
    assert not broken, "\n".join(broken)
    intervals = next(rate for rate in measured if rate.what.startswith("95 % intervals"))
    assert intervals.of >= LEAST_INTERVALS
