"""What streams have sent lately: kept, merged, shown in part and painted."""

from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page
from tests.dashboard.modules.frames import packed

pytestmark = pytest.mark.browser

RATE_HZ = 20_000.0


HISTORY = """async ([frames, capacity, from, merged, pairs]) => {
  const { decode } = await import("/connection/frames.js");
  const { History } = await import("/traces/history.js");
  const kept = new History(capacity);
  for (const bytes of frames) kept.push(decode(new Uint8Array(bytes).buffer));
  const line = new Array(2 * pairs).fill(0);
  kept.fill(line, 0, from, merged);
  const { samples, lost, end, endS } = kept;
  return { line, samples, lost, end, endS };
}"""


def columns(rng: np.random.Generator, count: int) -> np.ndarray[Any, Any]:
    """Return least and greatest values of one channel, shape (1, 2, count)."""
    return np.sort(rng.normal(size=(1, 2, count)).astype(np.float32), axis=1)


def test_history_keeps_each_column_at_its_own_time(
    page: Page, rng: np.random.Generator
) -> None:
    first, second = columns(rng, 3), columns(rng, 3)
    later = packed(second, lost=160, first_sample=1_000 + (3 + 2) * 80)  # two columns are lost
    got = page.evaluate(HISTORY, [[packed(first), later], 6, 12, 1, 8])
    # Column 12 begins before sample 1000; six columns are kept, of them one of the first frame.
    expected = [None] * 4 + [*first[0, :, 2]] + [None] * 4 + [*second[0].T.ravel()]
    assert got["line"] == [None if v is None else float(v) for v in expected]
    assert (got["samples"], got["lost"], got["end"]) == (480, 160, 20)
    assert got["endS"] == pytest.approx(20 * 80 / RATE_HZ)


def test_history_merges_columns_without_losing_an_extreme(
    page: Page, rng: np.random.Generator
) -> None:
    long = columns(rng, 40)
    got = page.evaluate(HISTORY, [[packed(long)], 100, 12, 8, 6])
    low, high = (row.reshape(5, 8) for row in long[0])
    expected = np.ravel((low.min(axis=1), high.max(axis=1)), "F")
    assert got["line"] == [*(float(v) for v in expected), None, None]


def test_history_takes_frames_longer_than_itself_and_forgets_a_former_run(
    page: Page, rng: np.random.Generator
) -> None:
    former, long = columns(rng, 3), columns(rng, 10)
    got = page.evaluate(HISTORY, [[packed(former, run=1), packed(long, run=2)], 6, 16, 1, 6])
    assert got["line"] == [float(v) for v in long[0, :, 4:].T.ravel()]
    got = page.evaluate(HISTORY, [[packed(long, run=1), packed(former, run=2)], 6, 12, 1, 6])
    assert got["line"][6:] == [None] * 6


def test_history_is_not_spoilt_by_what_is_too_late_for_it(
    page: Page, rng: np.random.Generator
) -> None:
    late, long = columns(rng, 3), columns(rng, 6)
    newest = packed(long, first_sample=80_000)
    got = page.evaluate(HISTORY, [[newest, packed(late)], 6, 1_000, 1, 6])
    assert got["line"] == [float(v) for v in long[0].T.ravel()]


def test_the_axis_of_time_moves_stands_and_stays_within_what_is_kept(page: Page) -> None:
    got = page.evaluate(
        """async () => {
          const { TimeAxis } = await import("/traces/time_axis.js");
          const axis = new TimeAxis();
          const seen = [];
          const note = () => seen.push([axis.live, ...axis.range.map((s) => +s.toFixed(6))]);
          axis.advance(1000); note();
          axis.show(10); note();
          axis.look([-4, -3.5]); note();
          axis.advance(1003); note();        // time goes on, what is shown stands
          axis.show(1); note();              // around the same middle
          axis.look([5, 900]); note();       // no more than there is
          axis.look([-900, -899]); note();
          axis.look([-7, -7]); note();       // never nothing
          axis.resume(); note();
          axis.pause(); note();
          axis.advance(5); note();           // another run of the rig
          return seen;
        }"""
    )
    assert got == [
        [True, -2, 0],
        [True, -10, 0],
        [False, -4, -3.5],
        [False, -4, -3.5],
        [False, -4.25, -3.25],
        [False, -600, 0],
        [False, -600, -599],
        [False, -7.02, -7],
        [True, -2, 0],
        [False, -2, 0],
        [True, -2, 0],
    ]


def test_envelope_paints_from_the_least_to_the_greatest_value_and_leaves_gaps(
    page: Page, rng: np.random.Generator
) -> None:
    least = rng.uniform(-3.0, 0.0, 9)
    greatest = least + rng.uniform(0.0, 4.0, 9)
    least[4] = greatest[4] = np.nan
    values = [None if np.isnan(each) else each for each in np.ravel((least, greatest), "F")]
    ratio, painted = page.evaluate(
        """async (values) => {
          const { envelope } = await import("/canvas/envelope.js");
          const pen = new OffscreenCanvas(1, 1).getContext("2d");
          const times = values.map((_, i) => i);
          const valToPos = (value, axis) => (axis === "x" ? 10 : -20) * value;
          const { fill } = envelope({ data: [times, values], valToPos }, 1);
          const heights = Array.from({ length: 1200 }, (_, i) => (i - 600) / 5);
          const painted = times.filter((i) => i % 2 === 0).map((i) =>
            heights.filter((y) => pen.isPointInPath(fill, 10 * i + 0.01, y)));
          return [devicePixelRatio, painted.map((ys) => ys.length ? [ys[0], ys.at(-1)] : null)];
        }""",
        values,
    )
    assert painted[4] is None
    # Past the last column before a gap, and past the very last one, nothing is painted.
    for column in (0, 1, 2, 5, 6, 7):
        top, bottom = painted[column]
        assert top == pytest.approx(-20 * greatest[column] - 0.75 * ratio, abs=0.5)
        assert bottom == pytest.approx(-20 * least[column] + 0.75 * ratio, abs=0.5)
