"""Single recordings: `uv run pytest -n 0 -m blind tests/blind/test_one_recording.py`.

It goes on where it was stopped; lines, with their seeds, lie in the cache folder of pytest.
"""

import pytest
from scipy import stats
from tests.blind.numbered_lines import go_on, read
from tests.blind.one_recording import rates, run

RECORDINGS = 100
"""Sixty of all kinds, and forty swipes more that hide nothing."""


@pytest.mark.blind
@pytest.mark.timeout(2 * 3600)
def test_what_is_hidden_ranks_first_and_nothing_else(request: pytest.FixtureRequest) -> None:
    cache = request.config.cache
    assert cache is not None
    path = cache.mkdir("blind") / "one_recording.jsonl"
    for line in go_on(path, range(RECORDINGS), run):
        print(line["number"], line["seed"])  # noqa: T201
    found = rates([line for line in read(path) if line["number"] < RECORDINGS])
    hits, of = found["cause"]
    assert hits >= 0.85 * of
    quiet, of = found["none"]
    # At most 5 % false: more is refuted only beyond chance.
    assert stats.binomtest(of - quiet, of, 0.05, alternative="greater").pvalue > 0.05
    stopped, of = found["slip"]
    assert stopped == of
