"""The pure modules of the view of textures, in the browser that runs them."""

from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page

pytestmark = pytest.mark.browser


def call(page: Page, module: str, function: str, *arguments: Any) -> Any:
    return page.evaluate(
        """async ([module, name, given]) => {
          const made = (await import(`/textures/${module}.js`))[name](...given);
          return made?.samples ? { ...made, samples: [...made.samples] }
            : made instanceof Float32Array || made instanceof Float64Array ? [...made] : made;
        }""",
        [module, function, arguments],
    )


def test_extremes_lose_none(page: Page, rng: np.random.Generator) -> None:
    samples = rng.normal(size=1_003)
    found = np.array(call(page, "waveform", "extremes", samples.tolist(), 100))
    assert found.shape == (100, 2)
    assert found.min() == samples.min()
    assert found.max() == samples.max()
    few = call(page, "waveform", "extremes", [1.0, -2.0], 100)
    assert few == [[1.0, 1.0], [-2.0, -2.0]]


@pytest.mark.parametrize(
    ("text", "rate_hz", "expected"),
    [
        ("0.1\n0.2\n0.4", 100.0, {"samples": [0.1, 0.2, 0.4], "rateHz": 100.0}),
        ("t,f\n0,1\n0.5,2\n1,3\n", None, {"samples": [1.0, 2.0, 3.0], "rateHz": 2.0}),
        ("0.1\n0.2", None, None),
        ("0.1\nrough\n0.2", 100.0, None),
        ("0,1\n0,2", None, None),
        ("1,2,3\n1,2,3", 100.0, None),
        ("", 100.0, None),
    ],
)
def test_columns_are_read_as_far_as_they_can_be_drawn(
    page: Page, text: str, rate_hz: float | None, expected: Any
) -> None:
    assert call(page, "waveform", "columnsOf", text, rate_hz) == expected


def test_a_texture_sounds_as_it_is_felt_back_and_forth(page: Page) -> None:
    step = 0.01
    way = np.sin(2.0 * np.pi * 2.0 * step * np.arange(1_000)) * 0.1  # 2 per mm
    time = np.full(20, 0.2)
    courses = [
        {"per": "mm", "step": step, "friction_n": way.tolist()},
        {"per": "s", "step": 1e-3, "friction_n": time.tolist()},
    ]
    found = call(page, "preview", "stroked", courses[:1], 50.0)
    assert found["rateHz"] == pytest.approx(5_000.0)
    np.testing.assert_allclose(found["samples"], 1.5 * np.concatenate([way, way[::-1]]))
    both = call(page, "preview", "stroked", courses, 50.0)
    np.testing.assert_allclose(both["samples"], np.array(found["samples"]) + 0.3, atol=1e-12)
    assert call(page, "preview", "stroked", [], 50.0) is None


def test_samples_at_another_rate_are_the_same_course(page: Page) -> None:
    ramp = np.arange(100.0)
    found = np.array(call(page, "sound", "resampled", ramp.tolist(), 1_000.0, 4_000.0))
    np.testing.assert_allclose(found, np.minimum(np.arange(400) / 4.0, 99.0))
    level = call(page, "sound", "levelled", [0.1, -0.2])
    np.testing.assert_allclose(level, [0.25, -0.5])
    assert call(page, "sound", "levelled", [0.0, 0.0]) == [0.0, 0.0]


def test_edges_snap_to_the_screen_and_to_other_regions(page: Page) -> None:
    others = [{"x_mm": [30.0, 40.0]}, {"x_mm": [-1_000.0, 1_000.0]}]
    lines = call(page, "placing", "linesOf", others, "x_mm", 70.0)
    assert lines == [0.0, 70.0, 30.0, 40.0]
    assert call(page, "placing", "snapped", 29.2, lines) == 30.0
    assert call(page, "placing", "snapped", 25.26, lines) == 25.3
    assert call(page, "placing", "spanned", 39.5, 10.0, lines) == [10.0, 40.0]
    moved = ([10.0, 20.0], lines, 70.0)
    for by, expected in ((9.4, [20.0, 30.0]), (-50.0, [0.0, 10.0]), (5.0, [15.0, 25.0])):
        assert call(page, "placing", "moved", moved[0], by, *moved[1:]) == expected
    assert call(page, "placing", "resized", [10.0, 20.0], 1, 29.5, lines) == [10.0, 30.0]
    assert call(page, "placing", "resized", [10.0, 20.0], 0, 50.0, lines) == [19.0, 20.0]


def test_a_hand_holds_the_uppermost_region_but_not_the_whole_screen(page: Page) -> None:
    whole = {"x_mm": [-1_000.0, 1_000.0], "y_mm": [-1_000.0, 1_000.0]}
    lower = {"x_mm": [10.0, 30.0], "y_mm": [5.0, 25.0]}
    upper = {"x_mm": [20.0, 40.0], "y_mm": [5.0, 25.0]}

    def grip(x: float, y: float) -> Any:
        regions = [whole, lower, upper]
        return call(page, "placing", "gripAt", regions, [x, y], 1.0, [70.0, 35.0])

    assert grip(25.0, 15.0) == {"index": 2, "x": None, "y": None}
    assert grip(12.0, 15.0) == {"index": 1, "x": None, "y": None}
    assert grip(39.5, 24.5) == {"index": 2, "x": 1, "y": 1}
    assert grip(19.5, 15.0) == {"index": 2, "x": 0, "y": None}
    assert grip(60.0, 15.0) is None
