"""What explains little of a recording is not said to explain it."""

import pytest

from frictus_service.discovery.document import ParameterEstimate, RankedModel
from frictus_service.discovery.one_recording.phrasing import statement_of


@pytest.mark.parametrize(("explained", "part"), [(0.97, False), (0.2, True), (7e-4, True)])
def test_a_cause_that_takes_little_away_explains_a_part(explained: float, part: bool) -> None:
    delay = ParameterEstimate(value=1e-4, ci95=(9e-5, 1.1e-4), unit="s")
    model = RankedModel(
        causes=("channel_delay",),
        parameters={"channel_delay": {"delay_s": delay}},
        heldout_loglik=20.0,
        explained=explained,
        standard_error=2.0,
        aic=-30.0,
    )
    said = statement_of([model], beyond=True)
    assert f"{100.0 * explained:.3g} % of the mean square" in said
    assert ("explains a part of it" in said) == part
    assert ("has another cause" in said) == part
