"""The page before a service that is played here: what a real one does not do at will."""

import json
import struct
import time

import numpy as np
import pytest
from playwright.sync_api import Page, WebSocketRoute, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.modules.frames import RATE_HZ, packed

from frictus.messages import RigStatus
from frictus.websocket.messages import Pong, Rigs, Welcome

pytestmark = pytest.mark.browser

RUNS = {"rig1": 1, "rig2": 2}
CLIPPED = 1 << 1


def status_of(rig: str, owner: str | None = None) -> str:
    status = RigStatus(
        site="lab",
        rig=rig,
        version="0",
        run=RUNS[rig],
        utc_ns=time.time_ns(),
        state="disarmed" if owner is None else "armed",
        owner=owner,
        backend="replay",
        simulated=False,
        finger_source="touch",
        sample_rate_hz=RATE_HZ,
        block_samples=100,
        lead_ms=20.0,
        screen_mm=(70.0, 35.0),
        screen_peak_v=100.0,
        model_etag="m",
        model_placeholder=False,
        scene_etag="s",
    )
    return json.dumps({"op": "status", "rig": rig, "status": status.model_dump(mode="json")})


def force_of(rig: str, flags: int) -> bytes:
    frame = packed(np.zeros((3, 2, 5)), run=RUNS[rig])
    frame[6:8] = struct.pack("<H", flags)
    return bytes(frame)


def serve(page: Page, owner: str | None = None) -> list[object]:
    """Play a service with two rigs, and return the kinds of what it is asked."""
    watched = None
    kinds: list[object] = []

    def hear(socket: WebSocketRoute, asked: dict[str, object]) -> None:
        nonlocal watched
        watched = asked.get("rig", watched)
        kinds.append(asked["op"])
        match asked["op"]:
            case "hello":
                welcome = Welcome(
                    scopes=("read", "render"), site="lab", client="p", key="k", utc_us=1
                )
                socket.send(welcome.model_dump_json())
                socket.send(Rigs(rigs=tuple(RUNS), link=True).model_dump_json())
            case "watch" if asked["rig"] == "rig1":
                socket.send(status_of("rig1", owner))
                socket.send(force_of("rig1", CLIPPED))
            case "watch" if asked["rig"] == "rig2":
                socket.send(force_of("rig1", CLIPPED))  # it was on its way
                socket.send(status_of("rig2"))
                socket.send(force_of("rig2", 0))
            case "ping":
                if watched == "rig1":  # until it is seen
                    socket.send(force_of("rig1", CLIPPED))
                socket.send(Pong(id=int(str(asked["id"])), utc_us=1).model_dump_json())

    page.route_web_socket(
        "**/v1/live",
        lambda socket: socket.on_message(lambda data: hear(socket, json.loads(data))),
    )
    return kinds


def test_samples_of_the_rig_before_are_not_those_of_the_next(
    open_page: OpenPage, folder_url: str
) -> None:
    with open_page() as page:
        serve(page)
        page.goto(f"{folder_url}/#/live/rig1")
        count = page.locator("[data-stream=force] .count")
        expect(page.locator("#badges")).to_contain_text("Clipped")
        page.get_by_role("link", name="rig2", exact=True).click()
        expect(page).to_have_title("rig2: Live · frictus")
        # A badge is held for longer than it takes to come here.
        assert page.locator("#badges li").count() == 0
        expect(count).to_have_text("400 samples, 0 lost")
        page.get_by_role("button", name="10 s", exact=True).click()  # the words are renewed
        expect(count).to_have_text("400 samples, 0 lost")


def test_a_browser_that_may_keep_nothing_shows_and_stops_all_the_same(
    open_page: OpenPage, folder_url: str
) -> None:
    with open_page() as page:
        page.add_init_script(
            """for (const name of ["localStorage", "sessionStorage"]) {
              const get = () => { throw new DOMException("denied", "SecurityError"); };
              Object.defineProperty(window, name, { get });
            }"""
        )
        page.route(
            "**/v1/rigs/rig1/stop", lambda route: route.fulfill(json={"state": "stopping"})
        )
        serve(page)
        page.goto(f"{folder_url}/#/live/rig1")
        expect(page.locator("#connection")).to_have_text("Live")
        page.locator("#stop").click()
        expect(page.locator("#stop-outcome")).to_contain_text(
            "rig1 answered the stop: stopping"
        )
        dark = page.get_by_role("button", name="Dark", exact=True)
        dark.click()
        expect(dark).to_have_attribute("aria-pressed", "true")


@pytest.mark.parametrize(
    ("owner", "label", "sent"), [(None, "Arm", "arm"), ("p", "Disarm", "disarm")]
)
def test_a_double_click_is_one(
    open_page: OpenPage, folder_url: str, owner: str | None, label: str, sent: str
) -> None:
    with open_page() as page:
        kinds = serve(page, owner)
        page.goto(f"{folder_url}/#/live/rig1")
        page.get_by_role("button", name=label, exact=True).dblclick()
        if owner is None:  # a rig takes its time: until it has answered it is asked once
            expect(page.locator("#arm")).to_be_disabled()
        page.get_by_role("link", name="rig2", exact=True).click()
        expect(page).to_have_title("rig2: Live · frictus")
        assert [kind for kind in kinds if kind in ("arm", "disarm")] == [sent]
