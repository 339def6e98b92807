"""Each fault of an instrument spoils its own channel, by as much as it says, and no other."""

from dataclasses import fields, replace

import numpy as np
import pytest
from tests.blind.generator.faults import (
    APART_S,
    COARSE_N,
    FAULTS,
    FILTER_S,
    JITTER_S,
    MISSING,
    WANDERING_N,
)
from tests.service.identification.trials import Made, trial

from frictus_service.study.trial import Trial

OF_FORCE = {"crosstalk", "wandering_offsets", "coarse_force"}
OF_PLACE = {"filtered_reports", "whole_millimetres"}
OF_TIME = {"jittering_stamps", "started_apart"}


@pytest.fixture
def whole(rng: np.random.Generator) -> Trial:
    return trial(Made((100.0,), 60.0, seconds=4.0), rng)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_one_of_its_channels(
    name: str, whole: Trial, rng: np.random.Generator
) -> None:
    spoilt = FAULTS[name](whole, rng)
    changed = {
        field.name
        for field in fields(Trial)
        if isinstance(before := getattr(whole, field.name), np.ndarray)
        and not np.array_equal(before, getattr(spoilt, field.name))
    }
    if name in OF_FORCE:
        assert changed == {"force_n"}
    elif name in OF_PLACE:
        assert changed == {"position_mm"}
    elif name in OF_TIME:
        assert changed == {"position_t_s"}
    else:
        assert changed == {"position_mm", "position_t_s"}
    assert (np.diff(spoilt.position_t_s) > 0.0).all()


def test_faults_are_as_large_as_they_say(whole: Trial, rng: np.random.Generator) -> None:
    spoilt = {name: fault(whole, rng) for name, fault in FAULTS.items()}
    late_s = spoilt["jittering_stamps"].position_t_s - whole.position_t_s
    assert 0.25 * JITTER_S < np.mean(late_s) < 0.75 * JITTER_S
    assert np.ptp(spoilt["started_apart"].position_t_s - whole.position_t_s) < 1e-12
    assert abs(spoilt["started_apart"].position_t_s[0] - whole.position_t_s[0]) <= APART_S
    kept = spoilt["missing_reports"].position_t_s.size / whole.position_t_s.size
    assert 0.6 < kept < 1.0 - 0.5 * MISSING
    assert spoilt["whole_millimetres"].position_mm % 1.0 == pytest.approx(0.0)
    off_n = spoilt["coarse_force"].force_n - whole.force_n
    assert 0.4 * COARSE_N < np.abs(off_n).max() <= 0.5 * COARSE_N + 1e-12
    wandered_n = spoilt["wandering_offsets"].force_n[-1] - whole.force_n[-1]
    assert (np.abs(wandered_n) < 5.0 * np.array(WANDERING_N)).all()


def test_filtered_reports_of_a_steady_finger_come_later(
    whole: Trial, rng: np.random.Generator
) -> None:
    reports_s = np.arange(0.0, 2.0, 1.0 / 60.0)
    steady = np.column_stack([100.0 * reports_s, np.zeros(reports_s.size)])
    from_rest = replace(whole, position_mm=steady, position_t_s=reports_s)
    behind_mm = steady[-1, 0] - FAULTS["filtered_reports"](from_rest, rng).position_mm[-1, 0]
    # Of a first-order filter at 60 reports a second, half a report less than its time constant.
    assert behind_mm == pytest.approx(100.0 * (FILTER_S - 0.5 / 60.0), abs=0.2)
