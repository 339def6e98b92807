"""A form in words that a reader need not calculate with."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.forms import BANDS_HZ
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_service.discovery.beyond.beyond import SmoothDiscrepancy
from frictus_service.discovery.beyond.form_fit import FittedForm
from frictus_service.discovery.beyond.grammar import grammar
from frictus_service.discovery.beyond.phrasing import discrepancy_of, sentence


@pytest.mark.parametrize("part", ["gain", "cutoff"])
def test_a_step_is_told_as_a_factor(part: str) -> None:
    form = next(each for each in grammar() if each.id == f"{part}_switch_by_time")
    values = {"log_change": float(np.log(0.8)), "threshold_min": 2.5}
    half_width = {"log_change": float(np.log(1.25)), "threshold_min": 0.1}
    said = sentence(FittedForm(form, values, half_width, 0.0))
    assert said == (
        f"the {part} changes by a factor of 0.8 [0.64, 1] 2.5 [2.4, 2.6] min into the session"
    )


def test_a_dose_says_from_where_to_where_it_changes() -> None:
    form = next(
        each
        for each in grammar()
        if each.what.startswith("an echo") and "by_speed" in each.shapes
    )
    values = {"share": 0.2, "delay_s": 0.001, "by_speed": -0.5}
    said = sentence(FittedForm(form, values, {**values, "by_speed": 0.25}, 0.0))
    told = " at 60 mm/s, changing by -0.5 [-0.75, -0.25] of itself from there to 100 mm/s"
    assert said.endswith(told)


def conditions(rng: np.random.Generator, n: int, last_min: float) -> SlidingConditions:
    def between(low: float, high: float) -> FloatArray:
        drawn: FloatArray = rng.uniform(low, high, n)
        drawn[:2] = low, high
        return drawn

    return SlidingConditions(
        speed_mm_s=between(40.0, 130.0),
        normal_force_n=between(0.3, 0.5),
        position_mm=between(10.0, 50.0),
        direction=np.where(np.arange(n) % 2, 1.0, -1.0),
        minutes=between(0.5, last_min),
    )


@pytest.mark.parametrize(
    ("covariate", "levels"),
    [
        ("minutes", (0.5, 2.75, 5.0)),
        ("speed", (40.0, 70.0, 100.0)),  # an effect follows speeds no further
        ("force", (0.3, 0.4, 0.5)),
        ("direction", (-1.0, 1.0)),
        ("none", (0.0,)),
    ],
)
def test_a_discrepancy_is_drawn_where_it_was_measured(
    covariate: str, levels: tuple[float, ...], rng: np.random.Generator
) -> None:
    n_bands = len(BANDS_HZ)
    smooth = SmoothDiscrepancy(
        covariate, np.full(n_bands, 0.05), 1e-4 * np.eye(n_bands), 8, rng.normal(5.0, 1.0, 8)
    )
    beyond: Any = SimpleNamespace(smooth=smooth, form=None, smooth_in_model=True)
    drawn = discrepancy_of(beyond, np.array([50.0, 500.0]), conditions(rng, 20, 5.0))
    assert drawn is not None
    assert sorted({each.level for each in drawn.bins}) == pytest.approx(levels)
    lowest, highest = drawn.bins[0], drawn.bins[-1]
    if covariate == "minutes":  # a quarter of the way to the middle of 20 minutes, and half
        x = np.array([(2.0 * t - 20.0) / 20.0 for t in (0.5, 5.0)])
        at = [smooth.at(np.array([500.0]), float(each))[0].real[0] for each in x]
        told = [20.0 / np.log(10.0) * each for each in at]
        (first,) = [b for b in drawn.bins if b.level == lowest.level and b.tone_hz > 499.9]
        assert [first.size_db, highest.size_db] == pytest.approx(told)
