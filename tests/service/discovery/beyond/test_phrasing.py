"""A form in words that a reader need not calculate with."""

import numpy as np
import pytest

from frictus_service.discovery.beyond.form_fit import FittedForm
from frictus_service.discovery.beyond.grammar import grammar
from frictus_service.discovery.beyond.phrasing import sentence


@pytest.mark.parametrize("part", ["gain", "cutoff"])
def test_a_step_is_told_as_a_factor(part: str) -> None:
    form = next(each for each in grammar() if each.id == f"{part}_switch_by_time")
    values = {"log_change": float(np.log(0.8)), "threshold_min": 2.5}
    half_width = {"log_change": float(np.log(1.25)), "threshold_min": 0.1}
    said = sentence(FittedForm(form, values, half_width, 0.0))
    assert said == (
        f"the {part} changes by a factor of 0.8 [0.64, 1] 2.5 [2.4, 2.6] min into the session"
    )
