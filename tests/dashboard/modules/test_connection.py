"""Binary frames of the live connection, decoded by the page."""

import numpy as np
import pytest
from playwright.sync_api import Page
from tests.dashboard.modules.frames import packed

pytestmark = pytest.mark.browser

RATE_HZ = 20_000.0


def test_frame_is_decoded(page: Page, rng: np.random.Generator) -> None:
    data = rng.normal(size=(3, 2, 5)).astype(np.float32)
    frame = page.evaluate(
        """async (bytes) => {
          const { decode } = await import("/connection/frames.js");
          const frame = decode(new Uint8Array(bytes).buffer);
          const [low, high] = [frame.low, frame.high].map((rows) => rows.map((r) => [...r]));
          return { ...frame, low, high };
        }""",
        packed(data, lost=160),
    )
    np.testing.assert_array_equal(frame.pop("low"), data[:, 0])
    np.testing.assert_array_equal(frame.pop("high"), data[:, 1])
    assert frame == {
        "stream": "force",
        "channels": 3,
        "columns": 5,
        "flags": 64,
        "run": 7,
        "firstSample": 1_000,
        "lostSamples": 160,
        "sampleRateHz": RATE_HZ,
        "samplesPerColumn": 80,
        "raw": False,
    }


@pytest.mark.parametrize(
    ("place", "value"),
    [(0, 2), (2, 99), (44, 7), (12, 6)],
    ids=["version", "stream", "kind", "size"],
)
def test_what_is_no_frame_is_refused(page: Page, place: int, value: int) -> None:
    frame = packed(np.zeros((3, 2, 5)))
    frame[place] = value
    refused = page.evaluate(
        """async (frames) => {
          const { decode } = await import("/connection/frames.js");
          return frames.map((bytes) => {
            try { decode(new Uint8Array(bytes).buffer); } catch (error) { return error.name; }
          });
        }""",
        [frame, frame[:20]],
    )
    assert refused == ["RangeError", "RangeError"]


BROKEN = "new Response(new ReadableStream({ start: (body) => body.error(new TypeError('x')) }))"


@pytest.mark.parametrize(
    ("answer", "method", "told", "unknown"),
    [
        ("new Response('<html>', { status: 502 })", "PUT", 502, True),
        ("new Response('<html>', { status: 502 })", "GET", 502, False),
        ("new Response('<html>', { status: 413 })", "PUT", 413, False),  # it got not through
        (BROKEN, "PUT", "cannot be reached", True),
        (BROKEN, "GET", "cannot be reached", False),
    ],
    ids=["proxy", "proxy, read", "proxy, refused", "broken off", "broken off, read"],
)
def test_an_answer_that_is_none_of_the_service_is_told_in_words(
    page: Page, answer: str, method: str, told: str | int, unknown: bool
) -> None:
    name, words, outcome = page.evaluate(
        """async ([answer, method]) => {
          const { outcomeUnknown, request } = await import("/connection/api.js");
          const { fetch } = window;
          window.fetch = async () => new Function(`return ${answer}`)();
          try {
            await request(method, "/anything");
          } catch (error) {
            return [error.constructor.name, error.message, outcomeUnknown(error)];
          } finally {
            window.fetch = fetch;
          }
        }""",
        [answer, method],
    )
    assert name == "Silence"  # a stop is sent again, an event stream is opened again
    assert str(told) in words
    assert outcome == unknown
