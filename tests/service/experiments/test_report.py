"""What is said of a condition."""

from frictus.experiment import ConditionResult
from frictus.experiment.psychometrics.fitting import Estimate, PsychometricFit
from frictus_service.experiments.report import result_lines


def test_a_setting_has_the_unit_of_its_level_and_an_exponent_none() -> None:
    found = Estimate(0.25, 0.2, 0.3)
    result = ConditionResult("c", 8, 0, 0, None, "mm", exponent=found, setting=found)
    assert result_lines(result)[1:] == [
        "  exponent: 0.25 (95 %: 0.2 to 0.3)",
        "  setting: 0.25 mm (95 %: 0.2 to 0.3)",
    ]


def test_threshold_and_slope_are_told_with_their_intervals() -> None:
    threshold, ml, slope = Estimate(2, 1, 4), Estimate(3, 1.5, 5), Estimate(2.5, 0.7, 8.75)
    fitted = PsychometricFit(threshold, ml, slope, 0.5, 0.031, 40, False)
    result = ConditionResult("c", 40, 0, 0, None, "dB", fit=fitted)
    assert result_lines(result)[1:] == [
        "  threshold: 2 dB (95 %: 1 to 4)",
        "  by likelihood: 3 dB (95 %: 1.5 to 5)",
        "  slope: 2.5 (95 %: 0.7 to 8.75)",
        "  lapses 3.1 %",
    ]


def test_why_nothing_was_estimated_is_told() -> None:
    result = ConditionResult("c", 8, 0, 0, None, "dB", undetermined="no exponent: why")
    assert result_lines(result)[1:] == ["  no exponent: why"]
