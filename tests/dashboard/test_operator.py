"""What an operator reads where a rig trips, or its process ends, before a real daemon."""

import os
import re
import signal
import sys
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import (
    WIDTHS,
    Lab,
    enter,
    expect_no_violations,
    read_only,
    running,
)
from tests.patience import PATIENT

from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.guided import ClientFinger

pytestmark = [pytest.mark.browser, pytest.mark.timeout(300)]

RETURN_MS = 120_000
"""A rig's process imports all that it needs first."""
LIMIT_N = 1.0


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon that trips where a pointer presses harder than `LIMIT_N`."""
    limits = PATIENT.model_copy(update={"force_limit_n": LIMIT_N})
    finger = SimulatedConfig(finger=ClientFinger())
    with running(tmp_path_factory.mktemp("lab"), limits=limits, backend=finger) as lab:
        yield lab


def events(page: Page) -> list[str]:
    """What the log says, the newest first, without the times."""
    page.locator("#events summary").click()
    told = page.locator("#events-list li").all_inner_texts()
    page.locator("#events summary").click()
    return [text.partition(" ")[2] for text in told]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL for others")
def test_a_rig_that_dies_while_held_is_told_from_its_end_to_its_return(
    page: Page, lab: Lab
) -> None:
    state, since, fault = (page.locator(f"#{name}") for name in ("state", "since", "fault"))
    with lab.rig.arm(lease_ms=10_000):
        expect(page.locator("#owner")).to_have_text("Held by tester")
        os.kill(lab.supervisor.pid_of("rig"), signal.SIGKILL)
        expect(state).to_have_text("Ended")
        expect(page.locator("#connection")).to_have_text("rig1 has ended")
        expect(since).to_have_text(re.compile(r"^held by tester until [\d:]{8}$"))
        why = re.compile(
            r"^[\d:]{8} internal fault: the rig process ended: killed by signal 9; the device "
            r"was reset\. The rig is started again by itself, disarmed, and needs no reset\. "
            r"Its scene is gone, and its model is that of its start: set both again\."
        )
        expect(fault).to_have_text(why)
        told = fault.inner_text()
        expect(page.locator("#arm")).to_be_hidden()
        expect_no_violations(page, WIDTHS)
        # Before the lease is given back: of a rig that is away nobody can take it.
        expect(state).to_have_text("Disarmed", timeout=RETURN_MS)
    # It is still told once it is back: when, why, who held it, and that nothing is to be reset.
    expect(fault).to_have_text(told)
    expect(since).to_have_text(re.compile(r"^held by tester until"))
    expect(page.locator("#reset")).to_be_hidden()
    assert [told for told in events(page) if not told.startswith("Losses")] == [
        "The rig was started again, disarmed; it needs no reset",
        "Tripped: internal fault, the rig process ended: killed by signal 9; "
        "the device was reset",
        "Disarmed: the rig process ended, held by tester",
        "Armed by tester",
    ]
    page.get_by_role("button", name="Arm", exact=True).click()
    expect(state).to_have_text("ARMED")
    expect(fault).to_be_empty()
    page.keyboard.press("Escape")
    expect(since).to_have_text(re.compile(r"^stopped by you at"))


def test_a_trip_is_told_and_reset_by_an_operator(
    page: Page, lab: Lab, open_page: OpenPage
) -> None:
    page.get_by_role("button", name="Arm", exact=True).click()
    expect(page.locator("#state")).to_have_text("ARMED")
    page.locator("#press").fill("2")
    box = page.locator("#surface").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    expect(page.locator("#state")).to_have_text("TRIPPED")
    page.mouse.up()
    lab.finger(lambda finger: not finger.in_contact)
    fault = page.locator("#fault")
    expect(fault).to_contain_text(re.compile(r"^[\d:]{8} safety fault: .*force"))
    expect(fault).to_contain_text("then reset the rig and arm again")
    expect(page.locator("#since")).to_have_text(re.compile(r"^held by you until [\d:]{8}$"))
    expect(page.locator("#arm")).to_be_hidden()
    expect(page.locator("#first")).to_be_hidden()
    expect_no_violations(page, WIDTHS)
    with read_only(lab) as url, open_page() as reader:
        enter(reader, url)
        expect(reader.locator("#state")).to_have_text("TRIPPED")
        expect(reader.locator("#fault")).to_contain_text("A reset needs the scope admin.")
        expect(reader.locator("#reset")).to_be_hidden()
    page.get_by_role("button", name="Reset the trip").click()
    expect(page.locator("#state")).to_have_text("Disarmed")
    expect(page.locator("#arm-outcome")).to_have_text("The rig is reset")
    expect(fault).to_be_empty()
    told = [told for told in events(page) if not told.startswith("Losses")]
    assert told[0] == "Reset by you"
    assert told[1].startswith("Tripped: safety fault, ")
    page.get_by_role("button", name="Arm", exact=True).click()
    expect(page.locator("#state")).to_have_text("ARMED")
    page.keyboard.press("Escape")
    expect(page.locator("#state")).to_have_text("Disarmed")
