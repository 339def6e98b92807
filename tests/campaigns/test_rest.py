"""What the reference allows and forbids, and clients that harm: a part of the campaign."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.campaigns import hostile_clients
from tests.campaigns.lines import run_all
from tests.campaigns.rest import LEAST, SCOPES, Bench, Campaign, batches, drawn, token_of

SEED = 20_261


def test_every_scope_and_kind_of_harm_has_its_batch() -> None:
    names = batches(LEAST * len(SCOPES))
    assert len(set(names)) == len(names) == len(SCOPES) + len(hostile_clients.KINDS)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with Bench(tmp_path_factory.mktemp("rest")).running() as bench:
        yield bench


@pytest.mark.long
@pytest.mark.parametrize("scope", ["none", "all"])
def test_what_is_answered_is_documented(bench: Bench, scope: str) -> None:
    # The first preview loads compiled code, beside whatever else this machine is doing.
    line = drawn(bench, scope, SEED, "fuzzing", 2, answer_s=60.0)
    assert line["failures"] == [], line.get("report")
    assert line["cases"] > len(SCOPES)
    assert bench.faults() == []


@pytest.mark.long
@pytest.mark.parametrize(
    "kind", ["half bodies", "floods", "malformed frames", "compressed bombs"]
)
def test_clients_that_harm_leave_nothing(bench: Bench, kind: str) -> None:
    config = bench.config
    line = hostile_clients.run(kind, config.api.port, bench.said.pid("api"), token_of("all"))
    assert line["failures"] == []
    assert bench.faults() == []


@pytest.mark.campaign
@pytest.mark.timeout(6 * 3600)
def test_ten_thousand_requests(lines_folder: Path) -> None:
    path = lines_folder / "rest.jsonl"
    with Campaign() as campaign:
        broken = run_all(path, batches(10_000), campaign.run)
    assert not broken, "\n".join(broken)
