"""What the page says first."""

import pytest
from playwright.sync_api import Page

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(("tripped", "kind"), [(False, "next"), (True, "none")])
def test_nobody_is_led_on_from_a_trip(page: Page, tripped: bool, kind: str) -> None:
    """Its fault says not to touch the screen, and what is to be done."""
    got = page.evaluate(
        """async (tripped) => {
          const { firstStepOf } = await import("/first_steps.js");
          const scene = { source: "scene", scene: { regions: [] } };
          const here = { connected: true, rig: "rig1", trusted: true, stage: true };
          return firstStepOf({ ...here, scene, tripped });
        }""",
        tripped,
    )
    assert got == {"kind": kind}
