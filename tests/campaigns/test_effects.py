"""Damaged effect files end in a texture or in words; a small part of the campaign."""

import json
import random
from pathlib import Path

import numpy as np
import pytest
from tests.campaigns import effects
from tests.campaigns.lines import run_all

from frictus.effects import EFFECT_SUFFIXES, render_effect

SEED = 20


@pytest.mark.parametrize("suffix", EFFECT_SUFFIXES)
def test_a_few_damaged_files_end_in_a_texture_or_in_words(suffix: str) -> None:
    line = effects.run(f"{suffix}/0", SEED, cases=15)
    assert line["failures"] == []
    assert sum(line["outcomes"].values()) == line["cases"]
    assert set(line["outcomes"]) == {"texture", "refused"}


@pytest.mark.parametrize("suffix", EFFECT_SUFFIXES)
def test_what_is_damaged_was_whole(suffix: str) -> None:
    rng = random.Random(SEED)
    for _ in range(5):
        effect = render_effect(json.dumps(effects.draw_effect(suffix, rng)), suffix)
        assert np.sqrt(np.mean(effect.signal**2)) > 0.01


@pytest.mark.campaign
@pytest.mark.timeout(3600)
def test_five_hundred_damaged_files(lines_folder: Path) -> None:
    broken = run_all(lines_folder / "effects.jsonl", effects.names(500), effects.run)
    assert not broken, "\n".join(broken)
