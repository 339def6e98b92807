"""Damaged effect files end in a texture or in words; a small part of the campaign."""

import json
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.campaigns import effect_files
from tests.campaigns.lines import run_all

from frictus.effect_files import EFFECT_SUFFIXES, render_effect
from frictus.hatt import import_node

SEED = 20
RUN = """
import json, sys
from tests.campaigns import effect_files
print(json.dumps(effect_files.run(sys.argv[1], int(sys.argv[2]), cases=15)))
"""
"""In a process of its own: what other tests took before is not these files' memory."""


@pytest.mark.parametrize(
    "suffix",
    [
        # Wavelets take most of a second to decode.
        pytest.param(each, marks=[pytest.mark.long] if each == ".hjif" else [])
        for each in effect_files.SUFFIXES
    ],
)
def test_a_few_damaged_files_end_in_a_texture_or_in_words(suffix: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", RUN, f"{suffix}/0", str(SEED)],
        cwd=Path(__file__).parents[2],
        check=True,
        capture_output=True,
        text=True,
        timeout=100.0,
    )
    line = json.loads(done.stdout)
    assert line["failures"] == []
    assert sum(line["outcomes"].values()) == line["cases"]
    assert set(line["outcomes"]) == {"texture", "refused"}


@pytest.mark.parametrize("suffix", EFFECT_SUFFIXES)
def test_what_is_damaged_was_whole(suffix: str) -> None:
    rng = random.Random(SEED)
    for _ in range(5):
        if suffix == effect_files.BINARY:
            effect = render_effect(effect_files.draw_hmpg(rng), suffix)
        else:
            effect = render_effect(json.dumps(effect_files.draw_effect(suffix, rng)), suffix)
        assert np.sqrt(np.mean(effect.signal**2)) > 0.01


def test_what_is_damaged_of_hatt_was_whole() -> None:
    rng = random.Random(SEED)
    for _ in range(5):
        assert import_node(effect_files.draw_hatt(rng).decode(), (100.0, 1.0), 0.01).components


@pytest.mark.campaign
@pytest.mark.timeout(3600)
def test_five_hundred_damaged_files(lines_folder: Path) -> None:
    broken = run_all(
        lines_folder / "effect_files.jsonl", effect_files.names(500), effect_files.run
    )
    assert not broken, "\n".join(broken)
