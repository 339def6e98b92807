"""A form is fitted to the bottom: remainders that are the form itself, without a study."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from scipy.special import expit

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.paths import factor_of
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Simulator
from frictus_service.discovery.beyond.form_fit import (
    FittedForm,
    Remainder,
    fit_form,
    half_widths,
)
from frictus_service.discovery.beyond.grammar import Form, grammar

TONES_HZ = np.array(
    """
    35.4 50.0 64.9 85.9 107.3 142.6 199.5 256.9 294.4 434.1 566.9 715.5 1030.5 1375.0 1833.9
    """.split(),
    dtype=np.float64,
)
"""Of a study in which a resonance at 745 Hz was found at 828 Hz."""
NOISE = 0.01
N_UNITS = 8


@dataclass(frozen=True)
class Analytic(Remainder):
    """What an extra resonance with noise leaves, in size and phase at each tone."""

    noise: FloatArray = field(default_factory=lambda: np.zeros((N_UNITS, 2 * TONES_HZ.size)))
    true: Mapping[str, float] = field(default_factory=dict)
    last_shows: float = 1.0

    def rest(self, unit: int, effect: str, values: Mapping[str, float]) -> FloatArray:
        left = _log_factor(effect, self.true) - _log_factor(effect, values)
        shows = self.last_shows if unit == N_UNITS - 1 else 1.0
        readings: FloatArray = shows * left / NOISE + self.noise[unit]
        return readings

    def accuracy(self, unit: int) -> FloatArray:
        return np.full(2 * TONES_HZ.size, 1e-3)


def _log_factor(effect: str, values: Mapping[str, float]) -> FloatArray:
    if not values:
        return np.zeros(2 * TONES_HZ.size)
    everywhere = np.ones(TONES_HZ.size)
    at = SlidingConditions(
        speed_mm_s=60.0 * everywhere,
        normal_force_n=0.4 * everywhere,
        position_mm=35.0 * everywhere,
        direction=everywhere,
        minutes=everywhere,
    )
    paths = extended(Simulator(), [(effect, values)]).paths
    log = np.log(factor_of(paths, TONES_HZ, at) * everywhere)
    return np.concatenate([log.real, log.imag])


def _resonance() -> Form:
    return next(each for each in grammar() if each.id == "extra_resonance")


def _left_by(true: Mapping[str, float], noise: FloatArray) -> Analytic:
    nothing: Any = None  # of a study and its model it asks nothing
    return Analytic(nothing, nothing, (), (1.0,) * N_UNITS, noise, true)


@pytest.mark.parametrize(("depth", "begin_hz"), [(0.2, 862.0), (0.3, 600.0)])
def test_a_resonance_between_two_tones_is_found_from_the_next_of_the_grid(
    depth: float, begin_hz: float
) -> None:
    """Depth, damping and frequency trade: cut off one by one, a step no longer leads down."""
    true = {"depth": 0.39, "frequency_hz": 745.0, "damping": 0.07}
    remainder = _left_by(true, np.zeros((N_UNITS, 2 * TONES_HZ.size)))
    begin = {"depth": depth, "frequency_hz": begin_hz, "damping": 0.05}
    fitted = fit_form(remainder, _resonance(), begin, range(N_UNITS))
    assert fitted.values == pytest.approx(true, rel=1e-3)
    assert fitted.cost < 1e-3


def test_an_interval_holds_the_truth_as_often_as_it_says(rng: np.random.Generator) -> None:
    true = {"depth": 0.39, "frequency_hz": 745.0, "damping": 0.07}
    begin = {"depth": 0.3, "frequency_hz": 765.0, "damping": 0.1}
    held = 0
    for _ in range(25):
        remainder = _left_by(true, rng.normal(size=(N_UNITS, 2 * TONES_HZ.size)))
        low, high = fit_form(remainder, _resonance(), begin, range(N_UNITS)).interval(
            "frequency_hz"
        )
        held += low <= true["frequency_hz"] <= high
    assert held >= 18  # of 25; at 95 % fewer are as rare as 1 in 1e4


@pytest.mark.parametrize("shows", [0.0, 1e-7, 1e-3])
def test_who_shows_nothing_of_a_form_says_nothing_of_its_dose(
    shows: float, rng: np.random.Generator
) -> None:
    true = {"depth": 0.39, "frequency_hz": 745.0, "damping": 0.07}
    remainder = _left_by(true, rng.normal(size=(N_UNITS, 2 * TONES_HZ.size)))
    blind = replace(remainder, last_shows=shows)
    fitted = fit_form(blind, _resonance(), true, range(N_UNITS))
    without = fit_form(blind, _resonance(), true, range(N_UNITS - 1))
    assert fitted.values["depth"] == pytest.approx(without.values["depth"], rel=0.02)
    assert fitted.half_width["depth"] == pytest.approx(without.half_width["depth"], rel=0.05)


def test_an_interval_knows_no_units_of_parameters(rng: np.random.Generator) -> None:
    """A delay in s beside a slope by minute differ by more than rounding, in square."""
    slopes, rests = (
        list(rng.normal(size=(N_UNITS, 40, 2))),
        list(rng.normal(size=(N_UNITS, 40))),
    )
    accuracies, scale = [np.full(40, 0.01)] * N_UNITS, np.array([1e9, 0.1])
    plain = half_widths(slopes, rests, accuracies)
    scaled = half_widths([each * scale for each in slopes], rests, accuracies)
    np.testing.assert_allclose(scaled, plain / scale)


def test_a_fit_goes_on_while_its_interval_changes() -> None:
    form = _resonance()
    values = {"depth": 0.3, "frequency_hz": 745.0, "damping": 0.07}
    half = {"depth": 0.1, "frequency_hz": 0.03, "damping": 0.2}
    settled = FittedForm(form, values, half, 1.0)
    elsewhere = FittedForm(form, {**values, "frequency_hz": 828.0}, half, 1.0)
    vague = FittedForm(form, values, {**half, "frequency_hz": 0.1}, 1.0)
    assert settled.is_near(settled)
    assert not settled.is_near(elsewhere)
    assert not settled.is_near(vague)
    assert not vague.is_near(settled)


def test_a_form_that_does_nothing_where_it_begins_stays_there() -> None:
    """A switch at a time that no trial reached, as that of longer sessions of other people."""
    remainder = _left_by({}, np.ones((N_UNITS, 2 * TONES_HZ.size)))
    form = next(each for each in grammar() if each.id == "cutoff_switch_by_time")
    begin = {form.dose: -3.0, **dict.fromkeys(form.shapes, 16.0), "width_min": 0.07}
    fitted = fit_form(remainder, form, begin, range(N_UNITS))
    assert fitted.values == pytest.approx(begin)
    assert fitted.cost == pytest.approx(N_UNITS * 2 * TONES_HZ.size)


@dataclass(frozen=True)
class Changed(Remainder):
    """What a gain that is another from one trial to the next leaves: trials 0.2 min apart."""

    def rest(self, unit: int, effect: str, values: Mapping[str, float]) -> FloatArray:
        minutes = 0.2 * np.arange(30)
        true = np.log(0.8) * (minutes > 2.7)
        turned = expit((minutes - values["threshold_min"]) / values["width_min"])
        left = (true - values["log_change"] * turned) / NOISE
        readings: FloatArray = left - left.mean()  # everybody's own gain
        return readings

    def accuracy(self, unit: int) -> FloatArray:
        return np.full(30, 1e-3)


def test_what_is_changed_between_two_trials_has_its_size() -> None:
    nothing: Any = None
    remainder = Changed(nothing, nothing, (), (1.0,) * N_UNITS)
    form = next(each for each in grammar() if each.id == "gain_switch_by_time")
    begin = {"log_change": -0.1, "threshold_min": 2.5}
    size, too_large = (
        fit_form(remainder, form, {**begin, "width_min": over}, range(N_UNITS)).values
        for over in (0.1, 0.2)
    )
    assert size["log_change"] == pytest.approx(np.log(0.8), rel=0.03)
    assert 2.6 <= size["threshold_min"] <= 2.8  # the trials before and after
    assert too_large["log_change"] < 1.04 * np.log(0.8)
