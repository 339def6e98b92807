"""A cause that cannot be is not named."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from tests.service.discovery.made import MOUNT, PAPER

from frictus_service.discovery.decision.decision import untenable
from frictus_service.discovery.decision.naming import CauseDecision
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.discovery.problem.problem import DiscoveryProblem

CANDIDATES = tuple(candidates_of("friction"))
COMPRESSION = [one.effect for one in CANDIDATES].index("amplitude_compression")
"""Its share is -0.25 to 0.125."""
PROBLEM = DiscoveryProblem(PAPER, MOUNT, "friction", (), CANDIDATES, ())
CAUSE = CauseDecision(
    candidate=COMPRESSION,
    verdict="confirmed",
    p_value=0.01,
    gain=np.ones(7),
    coefficients=np.array([0.08, 0.1, 0.12, 0.09, 0.11, 0.1, np.nan]),
    share=1.0,
    alike=(),
    near=(),
)


def banned(cause: CauseDecision) -> set[int]:
    """Return what of a model with one cause cannot stay."""
    said: Any = SimpleNamespace(named=(cause,))
    return untenable(PROBLEM, cast("Any", said))


def test_a_cause_that_shows_and_can_be_stays() -> None:
    assert not banned(CAUSE)
    # Some beyond, and an interval that is not.
    assert not banned(replace(CAUSE, coefficients=1.3 * CAUSE.coefficients))


def test_a_parameter_all_of_whose_interval_is_impossible_is_something_else() -> None:
    """At 10 kHz most harmonics are not seen, and 0.36 to 0.63 was confirmed of nothing."""
    for factor in (-6.0, 3.0):
        assert banned(replace(CAUSE, coefficients=factor * CAUSE.coefficients)) == {COMPRESSION}
    # A little beyond what is accepted it is told, and accepted as far as it goes.
    assert not banned(replace(CAUSE, coefficients=1.6 * CAUSE.coefficients))


def test_a_cause_of_which_nobody_says_anything_does_not_stay() -> None:
    """Its p is no number, which ended the analysis when it was written."""
    assert banned(replace(CAUSE, p_value=np.nan)) == {COMPRESSION}
