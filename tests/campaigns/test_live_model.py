"""What a model that follows its finger is measured by; a small part of it is marked."""

from pathlib import Path

import pytest
from tests.campaigns import live_model
from tests.campaigns.lines import read, run_all

SEED = 11


def test_sessions_have_names_of_their_own_and_kinds_are_mixed() -> None:
    names = live_model.names(2)
    assert len(set(names)) == len(names)
    first_half = {name.split("/")[0] for name in names[: len(names) // 2]}
    assert first_half == {name.split("/")[0] for name in names}


@pytest.mark.parametrize("kind", sorted({name.split("/")[0] for name in live_model.names(1)}))
def test_the_same_seed_is_the_same_session(kind: str) -> None:
    name = next(name for name in live_model.names(1) if name.startswith(kind))
    one, other = (live_model.plan_of(name, SEED) for _ in range(2))
    assert (one.person, one.seed, one.first, one.policy, one.seconds) == (
        other.person,
        other.seed,
        other.first,
        other.policy,
        other.seconds,
    )


@pytest.mark.campaign
@pytest.mark.timeout(600)
def test_a_finger_is_learned_and_a_wrong_rig_is_not(lines_folder: Path) -> None:
    path = lines_folder / "live_model.jsonl"
    wanted = ["learn/paper/1/0", "learn/fabric1/2/0", "moisture/both/0", "rig/delay/right/0"]
    assert run_all(path, wanted, live_model.run) == []
    lines = {line["name"]: line for line in read(path)}
    for name in wanted[:2]:
        assert lines[name]["observe"]["newest_db"] < 0.2
        assert lines[name]["in_force_db"] < 0.3
    assert lines["moisture/both/0"]["followed"]["newest_s"] is not None
    assert lines["rig/delay/right/0"]["in_force_db"] < 0.1
