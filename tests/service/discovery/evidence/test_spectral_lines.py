"""A harmonic is looked for only where nothing else can stand."""

import numpy as np
import pytest

from frictus_service.discovery.evidence.background import Lines, lines_of


def lines(*tones_hz: float) -> Lines:
    return lines_of(tones_hz, 7000.0, 20_000.0)


def seen(found: Lines) -> tuple[list[float], list[float]]:
    """Return the harmonics that are looked for."""
    second, third = (
        [found.tones.tones_hz[place] for place in places if place >= 0]
        for places in found.harmonics
    )
    return second, third


def test_one_tone() -> None:
    found = lines(100.0)
    assert seen(found) == ([200.0], [300.0])
    assert [found.tones.tones_hz[place] for place in found.mains] == [50.0, 60.0]
    assert {6000.0, 5900.0, 6100.0} < set(found.tones.tones_hz)


def test_a_blank_trial_has_mains_lines_alone() -> None:
    assert lines().tones.tones_hz == (50.0, 60.0)


@pytest.mark.parametrize(
    ("tone_hz", "second", "third"),
    [
        (2000.0, False, False),  # 4000 is its image; 6000 the carrier's
        (1500.0, True, False),  # 4500 is its image
        (2800.0, True, False),  # 8400 lies above
        (4100.0, False, False),
        (25.0, False, False),  # 50 is a mains line, and 75 is near 60
        (35.0, False, True),
        (40.0, True, True),
    ],
)
def test_where_something_else_stands(tone_hz: float, second: bool, third: bool) -> None:
    two, three = seen(lines(tone_hz))
    assert (bool(two), bool(three)) == (second, third)


def test_a_mains_line_beside_a_tone_is_left_out() -> None:
    assert lines(55.0).mains == (-1, -1)
    first, other = lines(45.0).mains
    assert first == -1
    assert other >= 0


def test_products_of_other_tones(rng: np.random.Generator) -> None:
    """310 - 100 is near 200, and 310 near 300."""
    assert seen(lines(100.0, 310.0)) == ([620.0], [930.0])
    assert seen(lines(100.0, 450.0)) == ([200.0, 900.0], [300.0, 1350.0])
    odd = tuple(5.0 * np.arange(7, 80, 2))
    assert seen(lines(*odd)) == ([], [])


def test_what_is_fitted_is_apart(rng: np.random.Generator) -> None:
    for count in (1, 2, 3):
        tones = tuple(rng.uniform(30.0, 2000.0, count))
        fitted = np.sort(lines(*tones).tones.tones_hz[count:])
        assert np.all(np.diff(fitted) >= 10.0)


@pytest.mark.parametrize("carrier_hz", [5000.0, 10_000.0, 4995.0])
def test_a_line_that_folds_to_an_end_of_the_spectrum_is_not_fitted(carrier_hz: float) -> None:
    """Sine is nothing there: amplitudes of all lines fitted beside it were arbitrary."""
    found = lines_of((100.0,), carrier_hz, 20_000.0)
    assert seen(found) == ([200.0], [300.0])
    assert min(found.tones.tones_hz) == 50.0
    assert max(found.tones.tones_hz) < 9950.0
