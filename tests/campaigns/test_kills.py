"""Kills, freezes and starts: what is drawn; the campaigns themselves are marked."""

import contextlib
import random
import sys
from pathlib import Path

import pytest
from tests.campaigns import kills, starts
from tests.campaigns.lines import run_all
from tests.campaigns.reliability import with_section

SEED = 7


def test_rig_and_supervisor_at_once_are_left_to_the_interlock() -> None:
    rng = random.Random(SEED)
    drawn = [kills.Attack.draw(rng) for _ in range(500)]
    assert {len(attack.signals) for attack in drawn} == {1, 2}
    assert not any({"rig", "supervisor"} <= attack.signals.keys() for attack in drawn)
    sent = {item for attack in drawn for item in attack.signals.items()}
    assert sent == {(target, name) for target in kills.TARGETS for name in kills.SIGNALS}


def test_a_section_is_replaced_and_the_others_stay() -> None:
    text = "# Title\n\nIntroduction.\n"
    text = with_section(text, "One", "first")
    text = with_section(text, "Two", "second")
    text = with_section(text, "One", "third")
    assert text == "# Title\n\nIntroduction.\n\n## One\n\nthird\n\n## Two\n\nsecond\n"
    assert with_section(text, "One", "third") == text


@pytest.mark.campaign
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals to stop a process")
@pytest.mark.timeout(6 * 3600)
def test_two_hundred_kills_and_freezes(lines_folder: Path) -> None:
    path = lines_folder / "kills.jsonl"
    with contextlib.closing(kills.Campaign()) as campaign:
        broken = run_all(path, kills.names(200), campaign.run)
    assert not broken, "\n".join(broken)


@pytest.mark.campaign
@pytest.mark.timeout(6 * 3600)
def test_starts_on_what_is_torn_taken_or_full(lines_folder: Path) -> None:
    path = lines_folder / "starts.jsonl"
    with contextlib.closing(starts.Campaign()) as campaign:
        broken = run_all(path, starts.names(5), campaign.run)
    assert not broken, "\n".join(broken)
