"""What the recorder does, in words."""

from typing import Any

import pytest
from playwright.sync_api import Page

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(
    ("changes", "age_ms", "kind", "text"),
    [
        ({}, 0, "runs", "Recording pilot: 1 min 05 s, 3.40 MB, nothing lost"),
        ({"lost_blocks": 1}, 0, "lossy", "Recording pilot: 1 min 05 s, 3.40 MB, 1 block lost"),
        (
            {},
            7_200,
            "unknown",
            "pilot: 1 min 05 s, 3.40 MB, nothing lost; no word from the recorder for 7 s",
        ),
        (
            {"recording": False},
            0,
            "idle",
            "The last one, pilot: 1 min 05 s, 3.40 MB, nothing lost.",
        ),
        (
            {"recording": False, "bytes_written": 0, "problem": "the disk is full"},
            0,
            "bad",
            "The last one: pilot. the disk is full",
        ),
    ],
)
def test_what_the_recorder_does_is_told_with_length_and_losses(
    page: Page, changes: dict[str, Any], age_ms: int, kind: str, text: str
) -> None:
    got = page.evaluate(
        """async ([changes, ageMs]) => {
          const { recordStateOf } = await import("/recordings/record_state.js");
          const recording = {
            recording: true, name: "pilot", seconds: 65.4, bytes_written: 3400000,
            lost_blocks: 0, problem: null, ...changes,
          };
          return recordStateOf({ rig: "rig1", recording, ageMs, trusted: true, may: true });
        }""",
        [changes, age_ms],
    )
    running = changes.get("recording", True)
    assert got == {"kind": kind, "text": text, "start": not running, "end": running}
