"""What is said of a condition."""

from frictus.experiment import ConditionResult
from frictus.experiment.psychometrics.fitting import Estimate
from frictus_service.experiments.report import result_lines


def test_a_setting_has_the_unit_of_its_level_and_an_exponent_none() -> None:
    found = Estimate(0.25, 0.2, 0.3)
    result = ConditionResult("c", 8, 0, 0, None, "mm", exponent=found, setting=found)
    assert result_lines(result)[1:] == [
        "  exponent: 0.25 (95 %: 0.2 to 0.3)",
        "  setting: 0.25 mm (95 %: 0.2 to 0.3)",
    ]
