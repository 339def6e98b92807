"""The terminal's picture of a calibration: reference above finger, what to do, how far."""

import io

import pytest
from rich.console import Console

from frictus.messages import GuidanceState
from frictus_service.calibration.job import Progress
from frictus_service.cli.guided import COLUMNS, picture

GUIDANCE = GuidanceState(
    utc_ns=1,
    participant="P01",
    phase="record",
    trial=2,
    seconds_left=3.2,
    target_speed_mm_s=40.0,
    target_force_n=0.4,
    reference_x_mm=65.0,
    span_mm=(5.0, 65.0),
    x_mm=35.0,
    speed_mm_s=38.4,
    force_n=0.33,
    colour="yellow",
)
PROGRESS = Progress(
    phase="record",
    trials_done=1,
    trials_planned=None,
    trials_rejected=0,
    recorded_s=4.0,
    precision=0.071,
)


def shown(guidance: GuidanceState | None, progress: Progress | None) -> list[str]:
    console = Console(width=200, file=(out := io.StringIO()))
    console.print(picture(guidance, progress))
    return out.getvalue().splitlines()


def test_the_finger_stands_below_the_reference() -> None:
    reference, finger, advice, standing = shown(GUIDANCE, PROGRESS)
    assert reference.index("□") == COLUMNS
    assert finger.index("■") == COLUMNS / 2
    assert "press harder" in advice
    assert "38 of 40 mm/s" in advice
    assert standing == "trials 1, rejected 0, 4 s recorded, cutoff known to ± 7.1 %"


def test_a_finger_that_is_not_seen_is_asked_for() -> None:
    unseen = {"x_mm": None, "speed_mm_s": None, "force_n": None, "colour": "grey"}
    _, finger, advice = shown(GUIDANCE.model_copy(update=unseen), None)
    assert finger.strip() == ""
    assert "put your finger on the screen" in advice
    assert "speed of 40 mm/s" in advice


@pytest.mark.parametrize("phase", ["break", "analyse", "done"])
def test_outside_of_trials_the_finger_rests(phase: str) -> None:
    (said,) = shown(GUIDANCE.model_copy(update={"phase": phase}), None)
    assert said == f"{phase}: lift your finger, 3 s left"


def test_nothing_is_shown_before_anything_is_known() -> None:
    assert shown(None, None) == []


def test_planned_trials_and_news_are_told() -> None:
    news = PROGRESS.model_copy(update={"trials_planned": 375, "message": "trial 1 accepted"})
    (standing,) = shown(None, news)
    assert standing.startswith("trials 1 of 375, ")
    assert standing.endswith("; trial 1 accepted")
