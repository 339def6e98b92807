"""What the rows of a log say of a condition."""

from typing import Any, Literal

import pytest

from frictus import Component, Spectrum
from frictus.experiment import ConstantPlan, Difference, Magnitude, Protocol, results

RIDGES = Spectrum(components=[Component(amplitude_n=0.06, cycles_per_mm=0.5)])
LEVELS = [1.0, 3.0, 6.0, 9.0]


def numbers_row(level: float, number: float) -> dict[str, Any]:
    return {
        "phase": "main",
        "condition": "ridges",
        "catch": False,
        "status": "answered",
        "flags": [],
        "level": level,
        "level_rendered": level,
        "response": repr(number),
        "correct": None,
        "positive": None,
    }


def rated(intervals: Literal[1, 2], numbers: list[float]) -> Any:
    protocol = Protocol(
        name="numbers",
        task=Magnitude(intervals=intervals),
        procedure=ConstantPlan(levels=LEVELS, repeats=1),
        conditions={"ridges": Difference(texture=RIDGES)},
    )
    rows = [numbers_row(*each) for each in zip(LEVELS, numbers, strict=False)]
    return results(protocol, rows)[0]


def test_of_one_interval_whose_level_is_in_db_the_power_law_is_of_amplitudes() -> None:
    amplitudes_n = [0.06 * 10.0 ** (level / 20.0) for level in LEVELS]
    found = rated(1, [30.0 * each**0.6 for each in amplitudes_n]).exponent
    assert (found.value, found.low, found.high) == pytest.approx((0.6, 0.6, 0.6))


def test_of_how_two_differ_the_power_law_is_of_the_difference() -> None:
    found = rated(2, [4.0 * level**0.8 for level in LEVELS]).exponent
    assert (found.value, found.low, found.high) == pytest.approx((0.8, 0.8, 0.8))


def test_of_numbers_of_0_it_is_said_that_a_power_law_has_none() -> None:
    found = rated(2, [0.0, 2.0, 0.0, 4.0])
    assert found.exponent is None
    assert found.undetermined.startswith("no exponent: 2 of 4 numbers are 0")


def test_of_too_few_numbers_it_is_said_how_many_it_takes() -> None:
    found = rated(2, [1.0, 2.0])
    assert found.exponent is None
    assert "3 numbers" in found.undetermined
