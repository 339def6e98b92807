"""What a calibration is good for, in words."""

import pytest
from playwright.sync_api import Page

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(
    ("protocol", "precision", "reached", "held_out_db", "forces_n", "good_for", "narrower"),
    [
        (
            "quick",
            0.04,
            True,
            0.34,
            [0.2, 0.6],
            "within 0.34 dB (rms) of what a texture asks for at 20 to 100 mm/s "
            "and 0.2 to 0.6 N, which people do not feel (from 1.21 dB on).",
            "About 80 s recorded in place of 20 s narrow it to 2 %",
        ),
        (
            "quick",
            0.1,
            False,
            1.5,
            [0.2, 0.6],
            "which people can feel (from 1.21 dB on).",
            "About 80 s recorded in place of 20 s narrow it to 5 %",
        ),
        (
            "paper",
            0.04,
            True,
            None,
            [0.4, 0.4],
            "20 to 100 mm/s and 0.4 N; how close they come to what is asked for is not known",
            "About four times as many trials halve the interval",
        ),
    ],
)
def test_what_a_calibration_is_good_for_and_what_would_narrow_it(
    page: Page,
    protocol: str,
    precision: float,
    reached: bool,
    held_out_db: float | None,
    forces_n: list[float],
    good_for: str,
    narrower: str,
) -> None:
    known, good, more = page.evaluate(
        """async (calibration) => {
          const { adviceOf } = await import("/calibrate/advice.js");
          return adviceOf(calibration);
        }""",
        {
            "participant": "P01",
            "spec": {"protocol": {"kind": protocol, "precision": 0.05}},
            "result": {
                "precision": precision,
                "reached": reached,
                "recorded_s": 20.0,
                "model": {"validity": {"speed_mm_s": [20, 100], "normal_force_n": forces_n}},
                "details": {
                    "diagnostics": {"held_out": held_out_db and {"held_out_db": held_out_db}}
                },
            },
        },
    )
    assert known.startswith(
        f"The cutoff is known within {100 * precision:.1f} % at every speed; what was asked"
    )
    assert ("not reached" in known) != reached
    assert good_for in good
    assert more.startswith(narrower)


def test_who_follows_guidance_that_ends_is_told_to_wait(page: Page) -> None:
    """As after a stop, until the session is over or begins again."""
    told = page.evaluate(
        """async () => {
          const { Guidance } = await import("/calibrate/guidance.js");
          const guidance = new Guidance(document.createElement("div"));
          const state = {
            phase: "record", trial: 1, trials: null, participant: "P01", message: "",
            seconds_left: 2, span_mm: [5, 65], reference_x_mm: 20, x_mm: 20, speed_mm_s: 40,
            force_n: 0.4, target_speed_mm_s: 40, target_force_n: 0.4, colour: "green",
          };
          guidance.setScreen([70, 35]);
          for (const utc_ns of [1, 2]) guidance.take({ ...state, utc_ns });
          for (let i = 0; i < 2; i++) await new Promise(requestAnimationFrame);
          const said = () => guidance.told.map((part) => part.textContent).filter(Boolean);
          const before = said();
          guidance.heardMs -= 2_000;
          guidance.look();
          return [before[0], said()];
        }"""
    )
    assert told == ["Recording", ["No guidance comes in", "Take your finger away, and wait."]]
