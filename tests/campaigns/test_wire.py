"""What is almost valid, from everybody, on every key: a short part of the wire campaign."""

import json
import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.campaigns.lines import go_on, read, run_all
from tests.campaigns.mutations import draw_mutant
from tests.campaigns.payloads import ANSWERED, KEYS, PUT, draw_payload
from tests.campaigns.wire import FINGERS, MODES, Batch, Bench, Campaign, Mode, batches

from frictus.block import Block
from frictus.keys import Topics
from frictus.messages import MESSAGES
from frictus.stream import StreamFrame

SEED = 20_261
SHORT = 120
UTC_NS = 1_767_225_600_000_000_000


@pytest.mark.parametrize("key", KEYS)
def test_what_is_drawn_is_valid(key: str) -> None:
    rng = random.Random(SEED)
    for _ in range(20):
        drawn = draw_payload(key, "somebody", UTC_NS, rng)
        if isinstance(drawn, bytes):
            (Block if PUT[key] is not Topics.TEXTURE else StreamFrame).unpack(drawn)
        else:
            message = ANSWERED.get(key) or PUT[key].message
            MESSAGES[message].from_json(json.dumps(drawn).encode())


def test_a_seed_makes_the_same_payloads() -> None:
    def drawn() -> list[bytes]:
        rng = random.Random(SEED)
        return [draw_mutant(key, "x", UTC_NS, 4_096, rng).payload for key in 20 * KEYS]

    assert drawn() == drawn()


def test_a_campaign_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    lines = tmp_path / "lines.jsonl"
    broken = {"b"}
    ran: list[tuple[str, int]] = []

    def run(name: str, seed: int) -> dict[str, object]:
        ran.append((name, seed))
        return {"failures": [{"what": "broken"}] if name in broken else []}

    list(go_on(lines, ["a", "b"], 5, run))
    broken.clear()
    list(go_on(lines, ["a", "b", "c"], None, run))
    assert ran[:3] == [("a", 5), ("b", 6), ("b", 6)]
    assert [line["name"] for line in read(lines)] == ["a", "b", "c"]
    list(go_on(lines, ["a", "b", "c"], None, run))
    assert len(ran) == 4


def test_every_service_and_mode_has_its_batches() -> None:
    names = batches(len(FINGERS) * len(MODES) * 250)
    assert len(set(names)) == len(FINGERS) * len(MODES)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with Bench("steady", tmp_path_factory.mktemp("wire")).running() as bench:
        yield bench


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
def test_no_payload_ends_trips_or_drives_anything(bench: Bench, mode: Mode) -> None:
    line = Batch(bench, mode, SEED).run(SHORT)
    assert line["failures"] == []
    assert {"put", "bad_request"} <= line["outcomes"].keys()


@pytest.mark.campaign
@pytest.mark.timeout(6 * 3600)
def test_fifty_thousand_payloads(lines_folder: Path) -> None:
    path = lines_folder / "wire.jsonl"
    with Campaign() as campaign:
        broken = run_all(path, batches(50_000), campaign.run)
    assert not broken, "\n".join(broken)
