"""Who changed what last, however calls of one name overlap."""

import itertools

import pytest

from frictus_service.daemon.last_calls import LastCalls


@pytest.mark.parametrize("refused", [(), ("ann",), ("ben",), ("ann", "ben")])
def test_of_calls_that_overlap_those_that_were_accepted_are_kept(
    refused: tuple[str, ...],
) -> None:
    calls = LastCalls(itertools.count(1).__next__)
    with calls.noted("reset", "before"):
        pass
    under_way = {name: calls.noted("reset", name) for name in ("ann", "ben")}
    for name, noted in under_way.items():
        noted.__enter__()
        assert calls.by_name()["reset"].client == name
    for name, noted in under_way.items():
        if name in refused:
            error = ValueError("refused")
            assert not noted.__exit__(ValueError, error, None)
        else:
            noted.__exit__(None, None, None)
    accepted = [name for name in under_way if name not in refused]
    assert calls.by_name()["reset"].client == (accepted or ["before"])[-1]
